import { describe, expect, it } from "vitest";
import type { ConstraintKind } from "../src/api/types";
import { addable, documentOf, fieldsOfDocument, partsOf, problemOf, sentence } from "../src/lib/constraints";

const SUN: ConstraintKind = {
  kind: "sun_elevation",
  doc: "The sun stands at least so high.",
  form: {
    properties: {
      at_least_rad: { type: "number", default: -Math.PI / 2, minimum: -Math.PI / 2 },
      at_most_rad: { type: "number", default: Math.PI / 2 },
      kind: { const: "sun_elevation", type: "string" },
    },
  },
};
const DUST: ConstraintKind = {
  kind: "dust_cover",
  doc: "",
  form: {
    properties: { level: { type: "string", enum: ["thin", "thick"] }, wiped: { type: "boolean" }, kind: { const: "dust_cover" } },
    required: ["level"],
  },
};
const WINDOW: ConstraintKind = { kind: "window", doc: "", form: { properties: { opens_s: { type: "number" } } } };
const ODD: ConstraintKind = { kind: "odd", doc: "", form: { properties: { ring: { type: "array" } } } };

const parts = (kind: ConstraintKind) => partsOf(kind) ?? [];

describe("conditions", () => {
  it("may be added where the page has fields for all that they hold", () => {
    expect(addable([WINDOW, SUN, ODD, DUST]).map((kind) => kind.kind)).toEqual(["sun_elevation", "dust_cover"]);
  });

  it("are degrees for people and radians on the wire", () => {
    expect(parts(SUN).map((part) => [part.label, part.unit, part.usual])).toEqual([["at least", "°", -90], ["at most", "°", 90]]);
    const sent = documentOf({ kind: "sun_elevation", values: { at_least_rad: 20, at_most_rad: null } }, parts(SUN));
    expect(sent).toEqual({ kind: "sun_elevation", at_least_rad: expect.closeTo(0.3490658504, 9) });
    expect(fieldsOfDocument(sent, parts(SUN)).values).toEqual({ at_least_rad: 20, at_most_rad: null });
  });

  it("come back as they were", () => {
    const document = { kind: "dust_cover", level: "thin", wiped: false };
    expect(documentOf(fieldsOfDocument(document, parts(DUST)), parts(DUST))).toEqual(document);
  });

  it("say what is wrong before the server does", () => {
    expect(problemOf({ kind: "sun_elevation", values: {} }, parts(SUN))).toBe("nothing is asked yet");
    expect(problemOf({ kind: "sun_elevation", values: { at_least_rad: -100 } }, parts(SUN))).toBe("at least: not below -90 °");
    expect(problemOf({ kind: "dust_cover", values: { wiped: true } }, parts(DUST))).toBe("level is needed");
    expect(problemOf({ kind: "dust_cover", values: { level: "thin" } }, parts(DUST))).toBeNull();
  });

  it("are told in a few words, and by their name where nothing is known of them", () => {
    expect(sentence({ kind: "sun_elevation", at_least_rad: 0.35, at_most_rad: Math.PI / 2 }, [SUN])).toBe("sun elevation at least 20.1°");
    expect(sentence({ kind: "seen_before", by: "x" }, [SUN])).toBe("seen before");
  });
});
