/** Keyboard: one table of keys. What is bound and what `?` shows are made from it alone. */

const FIELDS = new Set(["INPUT", "TEXTAREA", "SELECT"]);
const PRESSED = new Set(["BUTTON", "A", "SUMMARY"]);

interface Binding {
  /** Key presses as `keyName` says them. */
  readonly keys: readonly string[];
  readonly text: string;
  /** How the help writes the keys, where it is shorter than all of them. */
  readonly shown?: string;
}

const ARROWS = ["arrowleft", "arrowup", "arrowdown", "arrowright"] as const;
const held = (with_: string): string[] => ARROWS.map((key) => `${with_}+${key}`);

/** Keys by where they work: `page` everywhere, the others where their part of the page has the focus. */
export const KEYS = {
  page: {
    title: "Everywhere",
    keys: {
      target: { keys: ["t"], text: "add a target" },
      keepOut: { keys: ["o"], text: "draw a keep-out" },
      measure: { keys: ["m"], text: "measure distance, rise and angle" },
      value: { keys: ["v"], text: "value of the selected target's request" },
      map: { keys: ["2"], text: "map" },
      scene: { keys: ["3"], text: "3D view, and back" },
      panorama: { keys: ["4"], text: "panorama of the start, and back" },
      cancel: { keys: ["escape"], text: "back to selecting; then nothing selected" },
      remove: { keys: ["delete"], text: "delete what is selected" },
      undo: { keys: ["ctrl+z"], text: "undo your last change" },
      redo: { keys: ["ctrl+y", "ctrl+shift+z"], text: "redo it", shown: "Ctrl Y" },
      selection: { keys: ["s"], text: "sheet of the selection" },
      plan: { keys: ["p"], text: "plan" },
      whatIf: { keys: ["w"], text: "what if: try changes of the day on the plan" },
      compare: { keys: ["d"], text: "compare the plan with another" },
      run: { keys: ["r"], text: "run" },
      play: { keys: [" "], text: "play or pause the replay; hold or resume a live run" },
      before: { keys: ["["], text: "to the event before" },
      next: { keys: ["]"], text: "to the next event; let a held run take one" },
      stop: { keys: ["ctrl+."], text: "STOP the live runs of the mission at once", shown: "Ctrl ." },
      crl: { keys: ["c"], text: "CRL text" },
      review: { keys: ["a"], text: "review and approval" },
      forward: { keys: ["f6"], text: "to the next part of the page" },
      backward: { keys: ["shift+f6"], text: "to the part before" },
      help: { keys: ["?"], text: "this help" },
    },
  },
  cross: {
    title: "On map, 3D view and panorama",
    keys: {
      move: { keys: ARROWS, text: "move the crosshair" },
      far: { keys: held("shift"), text: "move it far", shown: "Shift ← ↑ ↓ →" },
      fine: { keys: held("alt"), text: "move it by a pixel", shown: "Alt ← ↑ ↓ →" },
      press: { keys: ["enter"], text: "click at the crosshair: select, pick, measure, draw" },
      closer: { keys: ["+", "="], text: "closer", shown: "+" },
      away: { keys: ["-"], text: "farther", shown: "−" },
    },
  },
  hold: {
    title: "On map and 3D view",
    keys: {
      grab: { keys: ["g"], text: "grab what is under the crosshair, else what is selected; arrows move it, Enter drops it, Esc puts it back" },
      left: { keys: [","], text: "turn the rover that is being moved left" },
      right: { keys: ["."], text: "turn it right" },
      whole: { keys: ["f"], text: "the whole site" },
    },
  },
  outline: {
    title: "On the map",
    keys: {
      last: { keys: ["shift+enter"], text: "last corner of an outline" },
      back: { keys: ["backspace"], text: "take a corner back; remove the corner that is held" },
    },
  },
  turn: {
    title: "On the 3D view",
    keys: {
      left: { keys: ["q"], text: "turn the view, or the mast, left" },
      right: { keys: ["e"], text: "turn it right" },
      up: { keys: ["pageup"], text: "look from higher; mast up" },
      down: { keys: ["pagedown"], text: "look from lower; mast down" },
    },
  },
  timeline: {
    title: "On the timeline",
    keys: {
      choose: { keys: ARROWS, text: "select the step before, the next one, the line above or below" },
      move: { keys: held("shift"), text: "move the view", shown: "Shift ← ↑ ↓ →" },
      closer: { keys: ["+", "="], text: "closer", shown: "+" },
      away: { keys: ["-"], text: "farther", shown: "−" },
      all: { keys: ["0"], text: "show all" },
    },
  },
  list: {
    title: "In lists, outline, tools and CRL text",
    keys: {
      walk: { keys: ["arrowup", "arrowdown"], text: "the one before, the next one" },
      ends: { keys: ["home", "end"], text: "the first, the last" },
    },
  },
  text: {
    title: "In CRL text",
    keys: {
      find: { keys: ["ctrl+f"], text: "find in the text" },
      finding: { keys: ["f8"], text: "to the next finding" },
      suggest: { keys: ["ctrl+ "], text: "what may stand here, while the text is edited", shown: "Ctrl Space" },
      fold: { keys: ["f9"], text: "fold or unfold the node" },
      unfold: { keys: ["shift+f9"], text: "unfold everything" },
    },
  },
  row: {
    title: "In tabs",
    keys: {
      walk: { keys: ["arrowleft", "arrowright"], text: "the one before, the next one" },
      ends: { keys: ["home", "end"], text: "the first, the last" },
    },
  },
  split: {
    title: "On a split between two parts",
    keys: { move: { keys: ARROWS, text: "move it" } },
  },
  picture: {
    title: "On a picture in the viewer",
    keys: {
      move: { keys: ARROWS, text: "move it" },
      closer: { keys: ["+", "="], text: "closer", shown: "+" },
      away: { keys: ["-"], text: "farther", shown: "−" },
      all: { keys: ["0"], text: "as it was" },
    },
  },
} as const satisfies Record<string, { title: string; keys: Record<string, Binding> }>;

export type Scope = keyof typeof KEYS;
type Actions<S extends Scope> = Record<keyof (typeof KEYS)[S]["keys"], (event: KeyboardEvent) => void>;
/** Does what a key stands for and says whether there was anything to do. */
export type Handler = (event: KeyboardEvent) => boolean;

/** Name of a key press: `t`, `ctrl+z`, `shift+enter`; of a single sign Shift is a part already. */
export function keyName(event: Pick<KeyboardEvent, "key" | "ctrlKey" | "metaKey" | "shiftKey" | "altKey">): string {
  const command = event.ctrlKey || event.metaKey;
  const shift = event.shiftKey && (command || event.key.length > 1);
  return `${event.altKey ? "alt+" : ""}${command ? "ctrl+" : ""}${shift ? "shift+" : ""}${event.key.toLowerCase()}`;
}

/** Bind the keys of one part of the page; every key of its table has to be given something to do. */
export function bind<S extends Scope>(scope: S, actions: Actions<S>): Handler {
  const table = new Map<string, (event: KeyboardEvent) => void>();
  for (const [name, binding] of Object.entries<Binding>(KEYS[scope].keys)) {
    for (const key of binding.keys) table.set(key, actions[name as keyof Actions<S>]);
  }
  return (event) => {
    const action = table.get(keyName(event));
    if (action === undefined || event.defaultPrevented) return false;
    event.preventDefault();
    event.stopPropagation();
    action(event);
    return true;
  };
}

/** Try handlers one after the other. */
export function chain(...handlers: readonly Handler[]): Handler {
  return (event) => handlers.some((handle) => handle(event));
}

/** Keys of the whole page: deaf while somebody writes in a field or a dialog is open. */
export function everywhere(handle: Handler): Handler {
  return (event) => {
    const target = event.target as HTMLElement | null;
    if (document.querySelector("dialog[open]") !== null) return false;
    const type = target instanceof HTMLInputElement ? target.type : "";
    const writing =
      target !== null &&
      (FIELDS.has(target.tagName) || target.isContentEditable) &&
      !["checkbox", "radio", "range", "button"].includes(type);
    const name = keyName(event);
    if (writing && !/^(shift\+)?f6$/.test(name)) {
      if (name === "escape") target?.blur();
      return false;
    }
    if (name === " " && target !== null && (PRESSED.has(target.tagName) || type !== "")) return false;
    return handle(event);
  };
}

/** Direction of an arrow key: right and up are positive. */
export function arrow(event: Pick<KeyboardEvent, "key">): [number, number] {
  const directions: Record<string, [number, number]> = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
  return directions[event.key] ?? [0, 0];
}

const SIGNS: Record<string, string> = {
  " ": "Space",
  arrowleft: "←",
  arrowup: "↑",
  arrowdown: "↓",
  arrowright: "→",
  escape: "Esc",
  delete: "Del",
  pageup: "Page ↑",
  pagedown: "Page ↓",
  ctrl: "Ctrl",
  shift: "Shift",
  alt: "Alt",
};

/** How people read the keys of a binding. */
export function written(binding: Binding): string {
  const sign = (key: string): string => SIGNS[key] ?? key.slice(0, 1).toUpperCase() + key.slice(1);
  return binding.shown ?? binding.keys.map((name) => name.split("+").map(sign).join(" ")).join(" ");
}

/** The whole table as the help shows it. */
export function keyList(): { title: string; keys: { keys: string; text: string }[] }[] {
  return Object.values(KEYS).map(({ title, keys }) => ({
    title,
    keys: Object.values<Binding>(keys).map((binding) => ({ keys: written(binding), text: binding.text })),
  }));
}
