/** Deep links: what is open and selected stands in the part of the address after `#`. */

export interface Selection {
  kind: "target" | "request" | "keep-out" | "step" | "branch" | "product" | "task";
  id: string;
}

export interface Route {
  mission: string | null;
  plan: string | null;
  run: string | null;
  tab: string | null;
  view: string | null;
  selection: Selection | null;
}

export const NOWHERE: Route = { mission: null, plan: null, run: null, tab: null, view: null, selection: null };

/** Whether a person still looks at the same sheet and the same thing; plan, run and view may have changed. */
export function isSamePlace(a: Route, b: Route): boolean {
  const chosen = [a.selection, b.selection].map((it) => it && `${it.kind}:${it.id}`);
  return a.mission === b.mission && a.tab === b.tab && chosen[0] === chosen[1];
}

const KINDS = new Set<string>(["target", "request", "keep-out", "step", "branch", "product", "task"]);

export function parseRoute(hash: string): Route {
  const [path = "", query = ""] = hash.replace(/^#\/?/, "").split("?");
  const [head, mission] = path.split("/");
  if (head !== "m" || mission === undefined || mission === "") return NOWHERE;
  const fields = new URLSearchParams(query);
  const chosen = fields.get("sel");
  const colon = chosen?.indexOf(":") ?? -1;
  const kind = chosen?.slice(0, colon) ?? "";
  return {
    mission: decodeURIComponent(mission),
    plan: fields.get("plan"),
    run: fields.get("run"),
    tab: fields.get("tab"),
    view: fields.get("view"),
    selection:
      chosen !== null && colon > 0 && KINDS.has(kind)
        ? { kind: kind as Selection["kind"], id: chosen.slice(colon + 1) }
        : null,
  };
}

export function formatRoute(route: Route): string {
  if (route.mission === null) return "#/";
  const fields = new URLSearchParams();
  if (route.plan !== null) fields.set("plan", route.plan);
  if (route.run !== null) fields.set("run", route.run);
  if (route.tab !== null) fields.set("tab", route.tab);
  if (route.view !== null) fields.set("view", route.view);
  if (route.selection !== null) fields.set("sel", `${route.selection.kind}:${route.selection.id}`);
  const query = fields.toString().replaceAll("%3A", ":").replaceAll("%2F", "/");
  return `#/m/${encodeURIComponent(route.mission)}${query === "" ? "" : `?${query}`}`;
}
