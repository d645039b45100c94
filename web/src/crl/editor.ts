/** The CodeMirror editor of a plan's text: what it does when the text is read, and what more when it is edited. */

import { acceptCompletion, autocompletion, closeBrackets, closeBracketsKeymap, type Completion, completionKeymap, startCompletion } from "@codemirror/autocomplete";
import { defaultKeymap, history, historyKeymap } from "@codemirror/commands";
import { bracketMatching, codeFolding, foldGutter, syntaxHighlighting, toggleFold, unfoldAll } from "@codemirror/language";
import { type Diagnostic, forceLinting, linter, lintGutter, nextDiagnostic } from "@codemirror/lint";
import { openSearchPanel, search, searchKeymap } from "@codemirror/search";
import { Compartment, EditorState, type Extension, Prec, StateEffect } from "@codemirror/state";
import { drawSelection, EditorView, highlightSpecialChars, hoverTooltip, keymap, lineNumbers } from "@codemirror/view";
import type { CrlFinding } from "../api/types";
import { bind, chain, type Handler } from "../lib/keys";
import { colours, crl, folding, structure } from "./language";
import { spanOf } from "./lines";
import { linked } from "./links";
import { theme } from "./theme";
import { helpAt, suggestionsAt, type Vocabulary } from "./words";

/** How long nobody writes before the text is checked. */
const CHECK_MS = 450;
const SEVERITIES: Record<string, Diagnostic["severity"]> = { error: "error", warning: "warning" };

export interface Told {
  vocabulary: () => Vocabulary;
  /** Findings on a text; they are asked for when it has changed. */
  findings: (text: string) => Promise<readonly CrlFinding[]>;
  /** Keys that only work while the text is read. */
  reading: Handler;
  edited: (text: string) => void;
  /** A node was chosen, by a click or by the cursor. */
  chosen: (node: string) => void;
  /** The words of help for where the cursor stands. */
  cursor: (help: string) => void;
}

const mode = new Compartment();
const check = StateEffect.define<null>();

function diagnostic(text: string, finding: CrlFinding): Diagnostic {
  const { from, to } = spanOf(text, finding.line, finding.column, finding.length);
  const message = [`${finding.code} ${finding.message}`, finding.hint].filter(Boolean).join("\n");
  return { from, to: Math.min(to, text.length), severity: SEVERITIES[finding.severity] ?? "info", message };
}

const ownerAt = (state: EditorState, at: number): string | null =>
  state.field(structure).owners[state.doc.lineAt(at).number - 1] ?? null;

function helpIn(told: Told): Extension {
  return hoverTooltip((view, at, side) => {
    // A word ends where the pointer is on its last half sign.
    const text = view.state.doc.toString();
    const found = helpAt(text, side < 0 ? at : Math.min(at + 1, text.length), told.vocabulary());
    if (found === null) return null;
    return {
      pos: found.from,
      end: found.to,
      create: () => {
        const dom = document.createElement("div");
        dom.className = "cm-crl-help";
        const title = document.createElement("b");
        title.textContent = found.title;
        dom.append(title, ...found.lines.map((line) => Object.assign(document.createElement("div"), { textContent: line })));
        return { dom };
      },
    };
  });
}

const reads = (told: Told, label: string): Extension => [
  EditorState.readOnly.of(true),
  EditorView.editable.of(false),
  EditorView.contentAttributes.of({ "aria-label": label, tabindex: "0", "data-testid": "crl" }),
  Prec.highest(EditorView.domEventHandlers({ keydown: (event) => told.reading(event) })),
  EditorView.domEventHandlers({
    click: (event, view) => {
      const at = view.posAtCoords({ x: event.clientX, y: event.clientY });
      const owner = at === null ? null : ownerAt(view.state, at);
      if (owner !== null) told.chosen(owner);
      return false;
    },
  }),
];

const edits = (told: Told, label: string): Extension => [
  EditorView.contentAttributes.of({ "aria-label": label, tabindex: "0", "data-testid": "crl", spellcheck: "false" }),
  EditorView.editorAttributes.of({ class: "cm-crl-edited" }),
  history(),
  drawSelection(),
  closeBrackets(),
  autocompletion({
    icons: false,
    override: [
      (context) => {
        const found = suggestionsAt(context.state.doc.toString(), context.pos, told.vocabulary());
        const before = context.state.sliceDoc(context.pos - 1, context.pos);
        if (found === null || (!context.explicit && found.from === context.pos && before !== "(")) return null;
        const options = found.options.map<Completion>(({ label: word, apply, detail, kind }) => ({
          label: word,
          detail,
          type: kind,
          ...(apply === undefined ? {} : { apply }),
        }));
        return { from: found.from, options };
      },
    ],
  }),
  // Tab leaves the editor; it takes a suggestion only while they are shown.
  keymap.of([...closeBracketsKeymap, ...completionKeymap, { key: "Tab", run: acceptCompletion }, ...historyKeymap, ...defaultKeymap]),
  EditorView.updateListener.of((change) => {
    if (change.docChanged) told.edited(change.state.doc.toString());
    if (!change.selectionSet && !change.docChanged) return;
    const at = change.state.selection.main.head;
    const found = helpAt(change.state.doc.toString(), at, told.vocabulary());
    told.cursor(found === null ? "" : [found.title, ...found.lines].join(" · "));
    const owner = ownerAt(change.state, at);
    if (owner !== null && change.transactions.some((one) => one.isUserEvent("select"))) told.chosen(owner);
  }),
];

/** Make the editor in an element. */
export function editorIn(parent: HTMLElement, text: string, told: Told): EditorView {
  const act = (command: (view: EditorView) => unknown) => (): void => void command(view);
  const keys = chain(
    bind("text", {
      find: act(openSearchPanel),
      finding: act(nextDiagnostic),
      suggest: act((editor) => !editor.state.readOnly && startCompletion(editor)),
      fold: act(toggleFold),
      unfold: act(unfoldAll),
    }),
  );
  const view = new EditorView({
    parent,
    doc: text,
    extensions: [
      mode.of([]),
      Prec.high(EditorView.domEventHandlers({ keydown: (event) => keys(event) })),
      lineNumbers(),
      foldGutter(),
      lintGutter(),
      highlightSpecialChars(),
      bracketMatching(),
      codeFolding({ placeholderText: "…" }),
      search({ top: true }),
      keymap.of(searchKeymap),
      EditorView.lineWrapping,
      crl,
      syntaxHighlighting(colours),
      structure,
      folding,
      linked,
      theme,
      helpIn(told),
      linter(
        async (editor) => {
          const checked = editor.state.doc.toString();
          return (await told.findings(checked)).map((finding) => diagnostic(checked, finding));
        },
        {
          delay: CHECK_MS,
          needsRefresh: (change) => change.transactions.some((one) => one.effects.some((effect) => effect.is(check))),
        },
      ),
    ],
  });
  // A key that closed something in the editor does not leave it too.
  parent.addEventListener("keydown", (event) => {
    if (event.key === "Escape" && event.defaultPrevented) event.stopPropagation();
  });
  return view;
}

/** Read or edit the text. */
export function setMode(view: EditorView, editing: boolean, told: Told, label: string): void {
  view.dispatch({ effects: mode.reconfigure(editing ? edits(told, label) : reads(told, label)) });
}

/** Put another text in the place of all that stands there, which undo does not bring back. */
export function setText(view: EditorView, text: string): void {
  if (view.state.doc.toString() === text) return;
  view.dispatch({ changes: { from: 0, to: view.state.doc.length, insert: text }, selection: { anchor: 0 } });
}

/** Ask for the findings again, although the text stands. */
export function checkNow(view: EditorView): void {
  view.dispatch({ effects: check.of(null) });
  forceLinting(view);
}

/** Bring an offset into sight, to the middle if it is out of it. */
export function showOffset(view: EditorView, at: number): void {
  const { top, bottom } = view.lineBlockAt(at);
  const { scrollTop, clientHeight } = view.scrollDOM;
  if (top < scrollTop || bottom > scrollTop + clientHeight) view.dispatch({ effects: EditorView.scrollIntoView(at, { y: "center" }) });
}
