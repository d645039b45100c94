/** One stop of the Tab key for many items: the arrow keys walk among them, as in any list, row of tabs or tools. */

import type { Attachment } from "svelte/attachments";
import { arrow, bind } from "../lib/keys";

const CHOSEN = '.selected, [aria-selected="true"], [aria-checked="true"]';

interface Way {
  /** `list` walks up and down, `row` left and right. */
  scope: "list" | "row";
  /** Whether walking also presses the item, as in lists and tabs; tools and links only take the focus. */
  press: boolean;
}

/** Walk among the elements that match `items`; the one that is chosen, else the last one visited, takes the Tab. */
export function roving(items: string, { scope, press }: Way): Attachment<HTMLElement> {
  return (element) => {
    let current: HTMLElement | null = null;
    const all = (): HTMLElement[] => [...element.querySelectorAll<HTMLElement>(items)].filter((item) => !item.matches(":disabled"));

    function settle(): void {
      const found = all();
      const focused = found.find((item) => item === document.activeElement);
      const chosen = found.find((item) => item.matches(CHOSEN));
      current = focused ?? chosen ?? (current !== null && found.includes(current) ? current : (found[0] ?? null));
      for (const item of found) {
        const index = item === current ? 0 : -1;
        if (item.tabIndex !== index || !item.hasAttribute("tabindex")) item.tabIndex = index;
      }
    }

    function go(item: HTMLElement | undefined): void {
      if (item === undefined) return;
      item.focus();
      if (press) item.click();
    }
    const handle = bind(scope, {
      walk: (event) => {
        const found = all();
        const [right, up] = arrow(event);
        go(found[found.indexOf(document.activeElement as HTMLElement) + (scope === "row" ? right : -up)]);
      },
      ends: (event) => go(all().at(event.key === "Home" ? 0 : -1)),
    });
    const keydown = (event: KeyboardEvent): void => {
      if ((event.target as HTMLElement).matches(items)) handle(event);
    };
    const watcher = new MutationObserver(settle);
    watcher.observe(element, { subtree: true, childList: true, attributes: true, attributeFilter: ["class", "aria-selected", "aria-checked", "disabled"] });
    element.addEventListener("keydown", keydown);
    element.addEventListener("focusin", settle);
    element.dataset.roving = scope;
    settle();
    return () => {
      watcher.disconnect();
      element.removeEventListener("keydown", keydown);
      element.removeEventListener("focusin", settle);
    };
  };
}
