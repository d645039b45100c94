/** Lines of a text of CRL: the node that each belongs to, and where a bracket that is folded begins and ends. */

import { type CrlNode, tokenize } from "../lib/crl";

/** Return for each line the innermost node that holds its first word; null where none does. */
export function ownersOf(text: string, nodes: readonly CrlNode[]): (string | null)[] {
  const lines = text.split("\n");
  const owners = lines.map<string | null>(() => null);
  const firsts: number[] = [];
  let start = 0;
  for (const line of lines) {
    firsts.push(start + line.search(/[^\s(]|$/));
    start += line.length + 1;
  }
  // Later nodes lie inside earlier ones, so the last one that is written down is the innermost.
  for (const node of nodes) {
    for (let k = node.line - 1; k < lines.length && (firsts[k] as number) < node.end; k += 1) {
      if ((firsts[k] as number) >= node.start && lines[k]?.trim() !== "") owners[k] = node.id;
    }
  }
  return owners;
}

/** Return the brackets that end on a later line than they begin, by the line they begin on (from 0): the outermost each. */
export function foldsOf(text: string): Map<number, { from: number; to: number }> {
  const folds = new Map<number, { from: number; to: number }>();
  const open: { offset: number; line: number }[] = [];
  let line = 0;
  for (const token of tokenize(text)) {
    if (token.kind === "paren" && token.text === "(") open.push({ offset: token.start, line });
    else if (token.kind === "paren") {
      const begun = open.pop();
      // Outer brackets close last and so replace the inner ones of their line.
      if (begun !== undefined && begun.line < line) folds.set(begun.line, { from: begun.offset, to: token.start });
    }
    for (const char of token.text) if (char === "\n") line += 1;
  }
  return folds;
}

/** Return the offsets that a place of the validator covers; it counts lines and characters from 1. */
export function spanOf(text: string, line: number | null, column: number | null, length = 1): { from: number; to: number } {
  let from = 0;
  for (let k = 1; k < (line ?? 1); k += 1) {
    const next = text.indexOf("\n", from);
    if (next < 0) break;
    from = next + 1;
  }
  const end = text.indexOf("\n", from);
  // The validator counts characters, and a character outside the basic plane has two units here.
  const signs = [...text.slice(from, end < 0 ? undefined : end)];
  const units = (count: number): number => signs.slice(0, count).join("").length;
  const first = Math.max(0, (column ?? 1) - 1);
  const start = from + units(first);
  return { from: start, to: Math.max(start, from + units(first + length)) };
}
