/**
 * Write `src/api/schema.d.ts` from the server's OpenAPI document, or with `--check` say whether it is current.
 *
 * The document comes from `outcrop openapi`, or from the file named by `--from FILE`.
 */

import { execFileSync } from "node:child_process";
import { existsSync, readFileSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import openapiTS, { astToString } from "openapi-typescript";

const here = dirname(fileURLToPath(import.meta.url));
const target = join(here, "src", "api", "schema.d.ts");
const heading = "// Made by `npm run api` from the server's OpenAPI document. Do not edit.\n\n";

function openapi(): string {
  const from = process.argv.indexOf("--from");
  const file = from > 0 ? process.argv[from + 1] : undefined;
  if (file !== undefined) return readFileSync(file, "utf8");
  const venv = join(here, "..", ".venv", "bin", "python");
  const python = process.env.OUTCROP_PYTHON ?? (existsSync(venv) ? venv : "python3");
  return execFileSync(python, ["-m", "ground.cli", "openapi"], {
    cwd: join(here, ".."),
    encoding: "utf8",
    maxBuffer: 64 * 1024 * 1024,
  });
}

const text = heading + astToString(await openapiTS(openapi(), { defaultNonNullable: false }));
if (!process.argv.includes("--check")) {
  writeFileSync(target, text);
} else if (!existsSync(target) || readFileSync(target, "utf8") !== text) {
  console.error("web/src/api/schema.d.ts is not what the server's OpenAPI document gives: run `npm run api` in web/");
  process.exit(1);
}
