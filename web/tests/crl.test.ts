import { EditorState } from "@codemirror/state";
import { ensureSyntaxTree } from "@codemirror/language";
import { describe, expect, it } from "vitest";
import { crl, structure } from "../src/crl/language";
import { foldsOf, ownersOf, spanOf } from "../src/crl/lines";
import { placeAt } from "../src/crl/place";
import { helpAt, suggestionsAt, type Vocabulary } from "../src/crl/words";
import { nodesOf } from "../src/lib/crl";

const value = (name: string, more: Partial<Vocabulary["actions"][number]["parameters"][number]> = {}) =>
  ({ name, type: "string", unit: "", required: false, minimum: null, maximum: null, choices: [], doc: "", ...more }) as const;
const KNOWN = {
  actions: [
    {
      name: "image",
      doc: "Take a picture.",
      parameters: [value("target", { required: true }), value("camera", { choices: ["navcam", "hazcam"] }), value("exposure_s", { type: "number", unit: "s", minimum: 0 })],
      results: [],
      one_of: [],
      needs: [],
      activity: "",
      instrument: "",
      duration: "",
    },
    { name: "place", doc: "Place a tool.", parameters: [value("tool")], results: [], one_of: [], needs: [], activity: "", instrument: "tool", duration: "" },
  ],
  telemetry: [{ key: "trackerstate", arguments: 1, value: value("trackerstate", { choices: ["tracked", "lost"], doc: "Whether a target is tracked." }) }],
  instruments: [{ name: "microscopic_imager", profile_name: "mi", doc: "Microscope" }],
  targets: [{ id: "tgt-1a", name: "North" }],
  requests: [{ id: "req-2b", name: "North · mi" }],
} as unknown as Vocabulary;

/** The labels at the bar in a text. */
function at(text: string): string[] {
  const offset = text.indexOf("|");
  return (suggestionsAt(text.replace("|", ""), offset, KNOWN)?.options ?? []).map((one) => one.label);
}

describe("what may stand at a place of CRL", () => {
  it("is a form that the field around it holds", () => {
    expect(at("(|")).toEqual(["plan", "task", "block", "concurrent-block", "branch"]);
    expect(at("(plan :node (|")).toEqual(["task", "block", "concurrent-block", "branch"]);
    expect(at("(block :id b :node-list ((ta|")).toContain("task");
    expect(at("(block :id b :node-list (|")).toEqual([]);
    expect(at("(branch :id b :options ((|")).toEqual(["option"]);
    expect(at("(plan :floating ((|")).toEqual(["floating-contingency"]);
  });

  it("is a field that the form has and does not hold yet", () => {
    const fields = at("(task :id a :|)");
    expect(fields).toContain(":action");
    expect(fields).not.toContain(":id");
    expect(fields).not.toContain(":node-list");
    expect(at("(branch :id b :if-none |")).toEqual(expect.arrayContaining([":fail", ":skip", ":wait", ":options"]));
  });

  it("is a name of the rover's dictionary or of the mission", () => {
    expect(at("(task :id a :action |")).toEqual(["image", "place"]);
    expect(at("(task :action image :parameters (|")).toEqual(["target", "camera", "exposure_s"]);
    expect(at("(task :action image :parameters (target = x |")).toEqual(["camera", "exposure_s"]);
    expect(at("(task :action image :parameters (camera = |")).toEqual(["navcam", "hazcam"]);
    expect(at("(task :action place :parameters (tool = |")).toEqual(["mi"]);
    const found = suggestionsAt("(task :metadata (target = ", 26, KNOWN);
    expect(found?.options).toEqual([{ label: "North", apply: "tgt-1a", detail: "tgt-1a", kind: "variable" }]);
  });

  it("is a condition, a key or another node", () => {
    expect(at("(task :id a :start-conditions ((|")).toEqual(["database", "known", "and", "or", "not"]);
    expect(at("(task :id a :start-conditions ((database (:|")).toEqual([":trackerstate"]);
    expect(at("(task :id a :start-conditions ((database (:trackerstate tgt-1a = |")).toEqual(["tracked", "lost", "North"]);
    expect(at("(block :id b :node-list ((task :id a) (task :id c :start-temporal-conditions ((|")).toEqual([":relative", "b", "a", "c"]);
    expect(at("(task :id c :start-temporal-conditions ((a |")).toEqual(["start", "end"]);
  });

  it("is nothing in a comment or a string", () => {
    expect(at("(task ; a comment (|")).toEqual([]);
    expect(at('(task :id a :name "(|"')).toEqual([]);
    expect(placeAt("; only", 3)).toBeNull();
  });

  it("begins where the word begins", () => {
    expect(suggestionsAt("(task :id a :act", 16, KNOWN)?.from).toBe(12);
  });
});

describe("what a word of CRL means", () => {
  const help = (text: string, word: string) => helpAt(text, text.indexOf(word) + 1, KNOWN);
  const TEXT = '(task :id a :duration (0 9) :action image :parameters (exposure_s = 2) :start-conditions ((database (:trackerstate "tgt-1a" = tracked))))';

  it("is told for forms, fields, actions, parameters, keys and ids", () => {
    expect(help(TEXT, "task")).toMatchObject({ title: "task", lines: ["One action of the rover.", "It must have :id :action."] });
    expect(help(TEXT, ":duration")?.lines[0]).toBe("(lo hi), short for the end condition (:relative (lo hi))");
    expect(help(TEXT, "image")?.lines.slice(0, 2)).toEqual(["Take a picture.", "target: string, required"]);
    expect(help(TEXT, "exposure_s")?.lines).toEqual(["number, s, at least 0"]);
    expect(help(TEXT, ":trackerstate")?.lines[0]).toBe("Whether a target is tracked.");
    expect(help(TEXT, '"tgt-1a"')?.title).toBe("North");
    expect(help("(branch :id b :if-none :skip)", ":if-none")?.lines[1]).toBe(":fail | :skip | :wait");
  });

  it("is not told where a word means nothing", () => {
    expect(help(TEXT, "(0 9)")).toBeNull();
    expect(help("(task :id task)", ":id task")?.title).toBe(":id");
    expect(helpAt("(task :id block)", 12, KNOWN)).toBeNull();
  });
});

describe("lines of CRL", () => {
  const TEXT = `(plan :id p
  :node (block :id root
    :node-list (
      (task :id t1
        :action image)
      (task :id t2 :action image))))`;

  it("belong to the innermost node that holds their first word", () => {
    expect(ownersOf(TEXT, nodesOf(TEXT))).toEqual([null, null, "root", "t1", "t1", "t2"]);
  });

  it("fold from the outermost bracket that ends later", () => {
    const folds = foldsOf(TEXT);
    expect([...folds.keys()].sort()).toEqual([0, 1, 2, 3]);
    expect(TEXT.slice(folds.get(3)?.from, (folds.get(3)?.to ?? 0) + 1)).toMatch(/^\(task :id t1[^]*image\)$/);
    expect(folds.get(0)?.to).toBe(TEXT.length - 1);
  });

  it("are found again from the places of the validator, also behind signs of two units", () => {
    const text = "(a\n  😀 wrong here)";
    const span = spanOf(text, 2, 5, 5);
    expect(text.slice(span.from, span.to)).toBe("wrong");
    expect(spanOf(text, 9, 1)).toEqual({ from: 3, to: 4 });
    expect(spanOf("", null, null)).toEqual({ from: 0, to: 0 });
  });

  it("are read anew with each change of the editor", () => {
    const state = EditorState.create({ doc: TEXT, extensions: [crl, structure] });
    const changed = state.update({ changes: { from: 0, insert: "; first\n" } }).state;
    expect(changed.field(structure).owners.slice(3)).toEqual(["root", "t1", "t1", "t2"]);
  });

  it("are coloured by what their words are, strings over several lines too", () => {
    const state = EditorState.create({ doc: '(task :id a :name "two\nlines" :reward 2.5) ; why', extensions: [crl] });
    const kinds: [string, string][] = [];
    ensureSyntaxTree(state, state.doc.length)?.iterate({
      enter: (node) => {
        if (node.name !== "Document") kinds.push([node.name, state.sliceDoc(node.from, node.to)]);
      },
    });
    expect(kinds).toContainEqual(["head", "task"]);
    expect(kinds).toContainEqual(["field", ":reward"]);
    expect(kinds).toContainEqual(["number", "2.5"]);
    expect(kinds.filter(([kind]) => kind === "string").map(([, text]) => text).join("")).toBe('"twolines"');
    expect(kinds).toContainEqual(["comment", "; why"]);
  });
});
