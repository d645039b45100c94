/** Say what the page says: cases as JSON from the standard input, the sentences of each as JSON to the output. */

import { text } from "node:stream/consumers";
import { createServer } from "vite";

const server = await createServer({ configFile: false, server: { middlewareMode: true, hmr: false, ws: false }, appType: "custom", logLevel: "error" });
const part = async (name: string) => await server.ssrLoadModule(`/src/lib/${name}.ts`);
const [explanations, campaign, tree, format] = await Promise.all(["explanations", "campaign", "plan-tree", "format"].map(part));

// Data of the study, of the forms that the server gives.
// eslint-disable-next-line @typescript-eslint/no-explicit-any
const KINDS: Record<string, (given: any) => unknown> = {
  "why-not": (answer) => explanations?.whyNotSentences(answer, (id: string) => id, format?.inUnits),
  comparison: (paired) => explanations?.comparedLines(paired),
  run: ({ outcome, plan }) => [tree?.noBranchTaken(outcome, tree.linesOf(plan))],
  campaign: (utility) => [campaign?.verdict(utility)?.text, campaign?.spreadOf(utility.quantiles)],
};

const cases = JSON.parse(await text(process.stdin)) as { kind: string; given: unknown }[];
console.log(JSON.stringify(cases.map(({ kind, given }) => KINDS[kind]?.(given))));
await server.close();
