/** CRL text cut into tokens, and the place of every node in it. */

import words from "./crl-words.json";

export interface Token {
  text: string;
  kind: "space" | "comment" | "paren" | "string" | "keyword" | "head" | "symbol" | "operator";
  start: number;
}

const HEADS = new Set(words.heads);

const OPERATORS = [...words.operators].sort((a, b) => b.length - a.length); // none has a sign that a pattern reads
const PATTERN = new RegExp(
  String.raw`(\s+)|(;[^\n]*)|([()])|("(?:[^"\\]|\\[^])*")|(${OPERATORS.join("|")})|([^\s()";=<>/]+)|([^])`,
  "gu",
);

export function tokenize(text: string): Token[] {
  const tokens: Token[] = [];
  for (const match of text.matchAll(PATTERN)) {
    const [whole, space, comment, paren, string, operator, word] = match;
    let kind: Token["kind"] = "symbol";
    if (space !== undefined) kind = "space";
    else if (comment !== undefined) kind = "comment";
    else if (paren !== undefined) kind = "paren";
    else if (string !== undefined) kind = "string";
    else if (operator !== undefined) kind = "operator";
    else if (word !== undefined) {
      if (word.startsWith(":")) kind = "keyword";
      else if (HEADS.has(word)) kind = "head";
    }
    tokens.push({ text: whole, kind, start: match.index });
  }
  return tokens;
}

export interface CrlNode {
  id: string;
  kind: string;
  /** Offsets of the opening bracket and behind the closing one. */
  start: number;
  end: number;
  line: number;
  action: string | null;
  /** Chance of success, where the plan gives one. */
  probability: number | null;
  metadata: Record<string, string>;
  parent: string | null;
}

/** Return the nodes and options that have an `:id`, in the order of the text. */
export function nodesOf(text: string): CrlNode[] {
  interface Frame {
    start: number;
    line: number;
    head: string | null;
    field: string | null;
    id: string | null;
    action: string | null;
    probability: number | null;
    metadata: Record<string, string>;
    pending: string | null;
    node: CrlNode | null;
  }
  const nodes: CrlNode[] = [];
  const stack: Frame[] = [];
  let line = 1;
  for (const token of tokenize(text)) {
    const top = stack[stack.length - 1];
    const plain = token.kind === "string" ? token.text.slice(1, -1).replace(/\\(.)/gs, "$1") : token.text;
    if (token.kind === "paren" && token.text === "(") {
      stack.push({
        start: token.start,
        line,
        head: null,
        field: null,
        id: null,
        action: null,
        probability: null,
        metadata: {},
        pending: null,
        node: null,
      });
    } else if (token.kind === "paren") {
      const done = stack.pop();
      if (done?.node) {
        done.node.end = token.start + 1;
        done.node.action = done.action;
        done.node.probability = done.probability;
        done.node.metadata = done.metadata;
      }
    } else if (top !== undefined && token.kind !== "space" && token.kind !== "comment") {
      if (token.kind === "head" && top.head === null && text[token.start - 1] !== ":") top.head = token.text;
      else if (token.kind === "keyword" && top.head !== null) top.field = token.text;
      else if (top.head !== null && top.field === ":id" && top.id === null) {
        top.id = plain;
        top.node = {
          id: plain,
          kind: top.head,
          start: top.start,
          end: text.length,
          line: top.line,
          action: null,
          probability: null,
          metadata: {},
          parent: [...stack].reverse().find((frame) => frame !== top && frame.node !== null)?.id ?? null,
        };
        if (top.head !== "plan") nodes.push(top.node);
      } else if (top.head !== null && top.field === ":action") top.action = plain;
      else if (top.head !== null && top.field === ":probability") top.probability = Number(plain);
      else {
        // name = value, inside the brackets behind :metadata
        const owner = stack[stack.length - 2];
        if (owner?.head && owner.field === ":metadata") {
          if (token.kind === "operator") continue;
          if (top.pending === null) top.pending = plain;
          else {
            owner.metadata[top.pending] = plain;
            top.pending = null;
          }
        }
      }
    }
    for (const char of token.text) if (char === "\n") line += 1;
  }
  return nodes;
}
