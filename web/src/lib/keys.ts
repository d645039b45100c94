/** Keyboard: one table of keys, deaf while somebody writes in a field. */

const FIELDS = new Set(["INPUT", "TEXTAREA", "SELECT"]);
const PRESSED = new Set(["BUTTON", "A", "SUMMARY"]);

/** Name of a key press: `t`, `ctrl+z`, `ctrl+shift+z`, `escape`. */
export function keyName(event: Pick<KeyboardEvent, "key" | "ctrlKey" | "metaKey" | "shiftKey">): string {
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key.toLowerCase();
  const held = event.ctrlKey || event.metaKey;
  const shift = event.shiftKey && held ? "shift+" : "";
  return `${held ? "ctrl+" : ""}${shift}${key}`;
}

export function shortcut(event: KeyboardEvent, table: Record<string, () => void>): void {
  const name = keyName(event);
  const target = event.target as HTMLElement | null;
  if (event.defaultPrevented || event.altKey) return;
  if (document.querySelector("dialog[open]") !== null) return;
  const type = target instanceof HTMLInputElement ? target.type : "";
  const writing =
    target !== null &&
    (FIELDS.has(target.tagName) || target.isContentEditable) &&
    !["checkbox", "radio", "range", "button"].includes(type);
  if (writing) {
    if (name === "escape") target?.blur();
    return;
  }
  if (name === " " && target !== null && (PRESSED.has(target.tagName) || type !== "")) return;
  const action = table[name];
  if (action === undefined) return;
  event.preventDefault();
  action();
}
