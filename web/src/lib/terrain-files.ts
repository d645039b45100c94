/** Which files make a terrain, as the server takes them; what is said here saves an upload that would be refused. */

export const TERRAIN_FILES = {
  terrain: [".zip", ".tif", ".tiff", ".glb", ".gltf", ".obj", ".ply"],
  ortho: [".png", ".jpg", ".jpeg", ".tif", ".tiff"],
} as const;

interface Named {
  name: string;
  size: number;
}

const endsWith = (name: string, suffixes: readonly string[]): boolean =>
  suffixes.some((suffix) => name.toLowerCase().endsWith(suffix));

/** Say what is wrong with a choice of files; empty when nothing is. */
export function terrainProblem(terrain: Named | null, ortho: Named | null): string {
  if (terrain === null) return "choose a terrain file";
  if (!endsWith(terrain.name, TERRAIN_FILES.terrain)) {
    return `${terrain.name} is not a terrain: choose ${TERRAIN_FILES.terrain.join(", ")}`;
  }
  if (terrain.size === 0) return `${terrain.name} is empty`;
  if (ortho === null) return "";
  if (!endsWith(terrain.name, [".tif", ".tiff"])) return "an ortho image goes with a GeoTIFF only; a zip or mesh brings its own";
  if (!endsWith(ortho.name, TERRAIN_FILES.ortho)) return `${ortho.name} is not an image: choose ${TERRAIN_FILES.ortho.join(", ")}`;
  return ortho.size === 0 ? `${ortho.name} is empty` : "";
}
