/** What ties the text to the rest of the page: lines of what is selected or was run, and names beside ids. */

import { type Extension, StateEffect, StateField } from "@codemirror/state";
import { Decoration, type DecorationSet, EditorView, ViewPlugin, type ViewUpdate, WidgetType } from "@codemirror/view";
import { structure } from "./language";

export interface Links {
  /** Nodes whose lines are lit, with all that lies in them. */
  lit: ReadonlySet<string>;
  /** How each node ended in the run that is open, as the name of a class. */
  outcomes: ReadonlyMap<string, string>;
  /** The name of what an id means; null where it has none. */
  nameOf: (id: string) => string | null;
}

const NOTHING: Links = { lit: new Set(), outcomes: new Map(), nameOf: () => null };
export const setLinks = StateEffect.define<Links>();

export const links = StateField.define<Links>({
  create: () => NOTHING,
  update: (value, change) => change.effects.find((effect) => effect.is(setLinks))?.value ?? value,
});

/** How far the rest of a line that is wrapped stands in, in signs, beside its own indentation. */
const HANGING = 2;
const DEEPEST = 24;

/** The rest of a wrapped line begins to the right of its first word. */
const hanging = EditorView.decorations.compute(["doc"], (state) => {
  const marks = [];
  for (let at = 0; at <= state.doc.length; ) {
    const line = state.doc.lineAt(at);
    const signs = HANGING + Math.min(DEEPEST, line.text.search(/\S|$/));
    const style = `padding-left: calc(${signs}ch + 4px); text-indent: -${signs}ch`;
    marks.push(Decoration.line({ attributes: { style } }).range(line.from));
    at = line.to + 1;
  }
  return Decoration.set(marks);
});

const lines = EditorView.decorations.compute([structure, links], (state) => {
  const { nodes, owners } = state.field(structure);
  const { lit, outcomes } = state.field(links);
  const parents = new Map(nodes.map((node) => [node.id, node.parent]));
  const isLit = (id: string | null): boolean => {
    for (let at = id; at !== null; at = parents.get(at) ?? null) if (lit.has(at)) return true;
    return false;
  };
  const marks = owners.flatMap((owner, k) => {
    if (owner === null || k >= state.doc.lines) return [];
    const classes = [isLit(owner) ? "lit" : "", outcomes.get(owner) ?? ""].filter(Boolean).join(" ");
    return classes === "" ? [] : [Decoration.line({ class: classes }).range(state.doc.line(k + 1).from)];
  });
  return Decoration.set(marks);
});

class Name extends WidgetType {
  constructor(readonly name: string) {
    super();
  }

  override eq(other: Name): boolean {
    return other.name === this.name;
  }

  override toDOM(): HTMLElement {
    const shown = document.createElement("span");
    shown.className = "cm-crl-name";
    shown.dataset.name = this.name;
    return shown;
  }
}

const ID = /(?:tgt|req)-[0-9a-z]+(?=["\s)]|$)/gm;

const names = ViewPlugin.fromClass(
  class {
    decorations: DecorationSet;

    constructor(view: EditorView) {
      this.decorations = this.read(view);
    }

    update(change: ViewUpdate): void {
      const named = change.transactions.some((one) => one.effects.some((effect) => effect.is(setLinks)));
      if (change.docChanged || change.viewportChanged || named) this.decorations = this.read(change.view);
    }

    private read(view: EditorView): DecorationSet {
      const { nameOf } = view.state.field(links);
      const found = view.visibleRanges.flatMap(({ from, to }) => {
        const text = view.state.sliceDoc(from, to);
        return [...text.matchAll(ID)].flatMap((match) => {
          const name = nameOf(match[0]);
          const end = match.index + match[0].length;
          const at = from + end + (text[end] === '"' ? 1 : 0);
          return name === null ? [] : [Decoration.widget({ widget: new Name(name), side: 1 }).range(at)];
        });
      });
      return Decoration.set(found);
    }
  },
  { decorations: (plugin) => plugin.decorations },
);

export const linked: Extension = [links, hanging, lines, names];
