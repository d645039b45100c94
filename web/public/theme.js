// Runs before the first paint, so that a page in light dress does not flash dark.
(() => {
  let theme = null;
  try {
    theme = localStorage.getItem("outcrop.theme");
  } catch {
    // Storage may be switched off; then the system's preference decides.
  }
  document.documentElement.dataset.theme =
    theme ?? (matchMedia("(prefers-color-scheme: light)").matches ? "light" : "dark");
})();
