/** Where a position stands in a text of CRL: the forms around it, and the word that ends there. */

import { type Token, tokenize } from "../lib/crl";

/** An open bracket before the position. */
export interface Frame {
  /** The form's kind; null where the bracket only holds a list. */
  head: string | null;
  /** The field whose value comes next, with its colon. */
  field: string | null;
  fields: readonly string[];
  /** What stands in it since its field began, operators left out; a bracket is `()`. */
  words: readonly string[];
  action: string | null;
}

export interface Place {
  frames: readonly Frame[];
  /** What is written of the word up to the position. */
  word: string;
  /** The token at the position, where there is one. */
  token: Token | null;
}

const WORDS = new Set<Token["kind"]>(["keyword", "head", "symbol", "string"]);

/** What a token says, without the quotes of a string. */
export const plain = (token: Token): string => (token.kind === "string" ? token.text.slice(1, -1).replace(/\\(.)/gs, "$1") : token.text);

/** The frame after another token in it. */
function after(frame: Frame, token: Token): Frame {
  const first = frame.head === null && frame.words.length === 0;
  if (token.kind === "head" && first) return { ...frame, head: token.text };
  if (token.kind === "keyword" && frame.head !== null) {
    return { ...frame, field: token.text, fields: [...frame.fields, token.text], words: [] };
  }
  const word = plain(token);
  return { ...frame, words: [...frame.words, word], action: frame.head !== null && frame.field === ":action" ? word : frame.action };
}

/** Return the place of an offset; null in a comment. */
export function placeAt(text: string, offset: number): Place | null {
  const frames: Frame[] = [];
  for (const token of tokenize(text)) {
    const end = token.start + token.text.length;
    if (token.start >= offset) break;
    if (token.kind === "comment" && offset <= end) return null;
    if (WORDS.has(token.kind) && offset <= end) return { frames, word: text.slice(token.start, offset), token };
    const top = frames.at(-1);
    if (token.text === "(" && token.kind === "paren") {
      frames.push({ head: null, field: null, fields: [], words: [], action: null });
    } else if (token.kind === "paren") {
      frames.pop();
      const around = frames.pop();
      if (around !== undefined) frames.push({ ...around, words: [...around.words, "()"] });
    } else if (top !== undefined && WORDS.has(token.kind)) {
      frames[frames.length - 1] = after(top, token);
    }
  }
  return { frames, word: "", token: null };
}

/** The form that holds a place, the brackets between both, and the innermost bracket. */
export interface Around {
  owner: Frame | null;
  depth: number;
  top: Frame;
}

export function around(place: Place): Around | null {
  const top = place.frames.at(-1);
  if (top === undefined) return null;
  const at = place.frames.findLastIndex((frame) => frame.head !== null);
  return { owner: at < 0 ? null : (place.frames[at] as Frame), depth: place.frames.length - 1 - at, top };
}
