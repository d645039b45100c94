/** Write `src/api/schema.d.ts`, the types of the REST interface, from the OpenAPI document beside the server's code. */

import { readFileSync, writeFileSync } from "node:fs";
import openapiTS, { astToString } from "openapi-typescript";

const document = readFileSync(new URL("../ground/openapi.json", import.meta.url), "utf8");
const heading = "// Made from ground/openapi.json by every build and check. Do not edit.\n\n";
writeFileSync(
  new URL("src/api/schema.d.ts", import.meta.url),
  heading + astToString(await openapiTS(document, { defaultNonNullable: false })),
);
