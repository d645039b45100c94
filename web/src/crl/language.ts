/** How CodeMirror colours, folds and indents CRL. */

import { foldService, HighlightStyle, StreamLanguage, type StringStream } from "@codemirror/language";
import { type EditorState, StateField } from "@codemirror/state";
import { tags } from "@lezer/highlight";
import { type CrlNode, nodesOf } from "../lib/crl";
import words from "../lib/crl-words.json";
import { foldsOf, ownersOf } from "./lines";

const HEADS = new Set(words.heads);
const NUMBER = /^[+-]?\d+(\.\d+)?([eE][+-]?\d+)?$/;

/** Read on to the end of a string, which may lie on a later line; return whether it ends on this one. */
function endsString(stream: StringStream): boolean {
  while (!stream.eol()) {
    const sign = stream.next();
    if (sign === "\\") stream.next();
    else if (sign === '"') return true;
  }
  return false;
}

export const crl = StreamLanguage.define<{ inString: boolean }>({
  name: "crl",
  startState: () => ({ inString: false }),
  token(stream, state) {
    if (state.inString || stream.eat('"') !== undefined) {
      state.inString = !endsString(stream);
      return "string";
    }
    if (stream.eatSpace()) return null;
    if (stream.match(/^;.*/)) return "comment";
    if (stream.eat(/[()]/) !== undefined) return "paren";
    if (stream.match(/^(?:\/=|<=|>=|[=<>])/)) return "operator";
    if (!stream.match(/^[^\s()";=<>/]+/)) {
      stream.next();
      return null;
    }
    const word = stream.current();
    if (word.startsWith(":")) return "field";
    if (HEADS.has(word)) return "head";
    return NUMBER.test(word) ? "number" : "symbol";
  },
  tokenTable: {
    head: tags.keyword,
    field: tags.propertyName,
    paren: tags.paren,
    number: tags.number,
    string: tags.string,
    operator: tags.operator,
    comment: tags.comment,
    symbol: tags.name,
  },
  languageData: { commentTokens: { line: ";" }, closeBrackets: { brackets: ["(", '"'] } },
});

/** Each has a contrast of at least 4.5 to 1 on a line that is lit, in both dresses. */
export const colours = HighlightStyle.define([
  { tag: tags.keyword, color: "var(--main)", fontWeight: "600" },
  { tag: tags.propertyName, color: "color-mix(in srgb, var(--branch) 75%, var(--text))" },
  { tag: tags.number, color: "var(--ok)" },
  { tag: tags.string, color: "var(--warn)" },
  { tag: [tags.comment, tags.paren], color: "var(--text2)" },
]);

/** What a text says of itself, read anew when it changes. */
export interface Structure {
  nodes: readonly CrlNode[];
  /** The node of each line. */
  owners: readonly (string | null)[];
  folds: ReadonlyMap<number, { from: number; to: number }>;
}

const read = (state: EditorState): Structure => {
  const text = state.doc.toString();
  const nodes = nodesOf(text);
  return { nodes, owners: ownersOf(text, nodes), folds: foldsOf(text) };
};

export const structure = StateField.define<Structure>({
  create: read,
  update: (value, change) => (change.docChanged ? read(change.state) : value),
});

/** A bracket that ends on a later line folds to the first line and its end. */
export const folding = foldService.of((state, from, to) => {
  const found = state.field(structure).folds.get(state.doc.lineAt(from).number - 1);
  return found === undefined || found.to <= to ? null : { from: to, to: found.to };
});
