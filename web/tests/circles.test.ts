import { readdirSync, readFileSync } from "node:fs";
import { dirname, join, normalize } from "node:path";
import { describe, expect, it } from "vitest";

/** What each file of a folder imports of the others, types as well. */
function importsOf(root: string): Map<string, string[]> {
  const files = readdirSync(root, { recursive: true, encoding: "utf8" }).filter((name) => /\.(ts|svelte)$/.test(name));
  return new Map(
    files.map((file) => {
      const named = [...readFileSync(join(root, file), "utf8").matchAll(/(?:from|import)\s*\(?\s*"(\.[^"]+)"/g)];
      const found = named.map(([, name]) => normalize(join(dirname(file), name ?? "")));
      return [file, found.flatMap((name) => files.filter((other) => other === name || other === `${name}.ts`))];
    }),
  );
}

/** The first way from a file back to itself; null where there is none. */
function circle(imports: Map<string, string[]>): string[] | null {
  const clear = new Set<string>();
  const visit = (file: string, way: string[]): string[] | null => {
    if (way.includes(file)) return [...way.slice(way.indexOf(file)), file];
    if (clear.has(file)) return null;
    for (const next of imports.get(file) ?? []) {
      const found = visit(next, [...way, file]);
      if (found !== null) return found;
    }
    clear.add(file);
    return null;
  };
  for (const file of imports.keys()) {
    const found = visit(file, []);
    if (found !== null) return found;
  }
  return null;
}

describe("modules", () => {
  it("form no circle", () => {
    const imports = importsOf(join(import.meta.dirname, "..", "src"));
    expect([...imports.values()].flat().length).toBeGreaterThan(200);
    expect(circle(imports)).toBeNull();
  });

  it("would be told of a circle", () => {
    expect(circle(new Map([["a", ["b"]], ["b", ["c"]], ["c", ["b"]]]))).toEqual(["b", "c", "b"]);
  });
});
