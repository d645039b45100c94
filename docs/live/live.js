// Every plan of a page that has a world below it can be run and changed there: the executive is Python and
// needs nothing else, so it runs in the browser. Plan and world stand in the page as text; nothing is sent anywhere.

const here = new URL(".", import.meta.url);
let python = null; // one for the page, loaded when first asked for

function load() {
  python ??= (async () => {
    const { loadPyodide } = await import(new URL("pyodide/pyodide.mjs", here));
    const loaded = await loadPyodide({ indexURL: new URL("pyodide/", here).href });
    const [archive, glue] = await Promise.all(["executive.zip", "run.py"].map((name) => fetched(name)));
    loaded.unpackArchive(await archive.arrayBuffer(), "zip", { extractDir: "/outcrop" });
    loaded.runPython("import sys; sys.path.insert(0, '/outcrop')");
    loaded.runPython(await glue.text());
    return loaded.globals.get("answer");
  })();
  python.catch(() => (python = null)); // the next click tries again
  return python;
}

async function fetched(name) {
  const answer = await fetch(new URL(name, here));
  if (!answer.ok) throw new Error(`${name} is not beside the page (${answer.status})`);
  return answer;
}

function made(tag, attributes = {}, ...children) {
  const svg = ["svg", "rect", "line", "text", "title"].includes(tag);
  const element = svg ? document.createElementNS("http://www.w3.org/2000/svg", tag) : document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

// Nodes of a trace with their starts and ends, in the order of their starts.
function spansOf(run) {
  const spans = new Map();
  for (const [t, event, node, outcome, reason] of run.events) {
    if (event === "start") spans.set(node, { node, from: t, to: null });
    if (event === "end") {
      const span = spans.get(node) ?? { node, from: t };
      spans.set(node, { ...span, to: t, outcome, reason });
    }
  }
  return [...spans.values()];
}

const ROW = 18;
const LEFT = 130;
const WIDTH = 700;

function timeline(run) {
  const spans = spansOf(run);
  const end = Math.max(1e-9, run.end_time ?? 0, ...run.events.map(([t]) => t));
  const x = (t) => LEFT + (t / end) * (WIDTH - LEFT - 10);
  const height = ROW * spans.length + 20;
  const drawing = made("svg", { viewBox: `0 0 ${WIDTH} ${height}`, role: "img", "aria-label": "When each node ran" });
  spans.forEach((span, row) => {
    const to = span.to ?? end;
    const state = span.outcome === "FAILED" ? "failed" : span.outcome === "SUCCEEDED" ? "" : "over";
    const bar = made("rect", {
      class: `bar ${state}`, x: x(span.from), y: row * ROW + 3, width: Math.max(2, x(to) - x(span.from)), height: ROW - 6,
    }, made("title", {}, `${span.node}: ${span.from} to ${to} s, ${span.outcome ?? "running"} ${span.reason ?? ""}`));
    drawing.append(made("text", { x: LEFT - 6, y: row * ROW + 13, "text-anchor": "end" }, span.node), bar);
  });
  for (const t of [0, end / 2, end]) {
    drawing.append(made("text", { x: x(t), y: height - 4, "text-anchor": t === 0 ? "start" : "end" }, `${+t.toFixed(1)} s`));
  }
  const now = made("line", { class: "now", y1: 0, y2: height - 16 });
  drawing.append(now);
  const show = (t) => {
    now.setAttribute("x1", x(t));
    now.setAttribute("x2", x(t));
  };
  return { drawing, end, show };
}

function replay(run) {
  const { drawing, end, show } = timeline(run);
  const slider = made("input", { type: "range", min: 0, max: end, step: end / 500, value: end, "aria-label": "Plan time" });
  const time = made("output");
  const events = made("ol", { class: "live-events" });
  for (const [t, ...rest] of run.events) events.append(made("li", { "data-t": t }, `${t} s  ${rest.join(" ")}`));
  const move = () => {
    const t = Number(slider.value);
    show(t);
    time.textContent = `${t.toFixed(1)} s of ${end} s`;
    for (const item of events.children) item.className = Number(item.dataset.t) <= t + 1e-9 ? "past" : "coming";
  };
  slider.addEventListener("input", move);
  move();
  const line = made("p", {}, `The plan ${run.plan_outcome === "SUCCEEDED" ? "succeeded" : `ended as ${run.plan_outcome}`} after ${run.end_time ?? end} s.`);
  return [line, drawing, made("div", { class: "live-replay" }, slider, time), events];
}

function openEditor(after, source, world) {
  const plan = made("textarea", { rows: Math.min(24, source.split("\n").length + 1), spellcheck: "false" });
  const place = made("textarea", { rows: Math.min(10, world.split("\n").length + 1), spellcheck: "false" });
  plan.value = source;
  place.value = world;
  const findings = made("ul", { class: "live-findings", "aria-live": "polite" });
  const came = made("div", { class: "live-run" });
  const panel = made(
    "section", { class: "live", "aria-label": "Plan, world and what came of it" },
    made("label", {}, "Plan (CRL)", plan), findings,
    made("label", {}, "World: durations and results of actions, events", place), came,
  );
  after.after(panel);

  const told = (text, kind, jump) => {
    const word = jump ? made("button", { type: "button" }, text) : text;
    if (jump) word.addEventListener("click", jump);
    findings.append(made("li", { class: kind }, word));
  };
  const at = (line, column, length) => () => {
    const start = plan.value.split("\n").slice(0, line - 1).reduce((sum, text) => sum + text.length + 1, 0) + column - 1;
    plan.focus();
    plan.setSelectionRange(start, start + Math.max(1, length ?? 1));
  };
  let asked = 0;
  const update = async () => {
    const mine = ++asked;
    panel.dataset.state = "busy";
    let found;
    try {
      if (!python) came.textContent = "Loading Python, about 13 MB the first time ...";
      const ask = await load();
      found = JSON.parse(ask(plan.value, place.value));
    } catch (error) {
      found = { findings: [], world: `Python could not be started: ${error.message}` };
    }
    if (mine !== asked) return;
    findings.replaceChildren();
    came.replaceChildren();
    for (const one of found.findings) {
      const where = one.line ? `line ${one.line}: ` : "";
      told(`${where}${one.message}${one.hint ? ` (${one.hint})` : ""}`, one.severity, one.line ? at(one.line, one.column, one.length) : null);
    }
    if (found.world) told(found.world, "error");
    if (found.run) came.append(...replay(found.run));
    panel.result = found;
    panel.dataset.state = "done";
  };
  let timer = 0;
  for (const field of [plan, place]) {
    field.addEventListener("input", () => {
      clearTimeout(timer);
      timer = setTimeout(update, 300); // while somebody types, the last word counts
    });
  }
  update();
  plan.focus();
}

for (const block of document.querySelectorAll(".language-lisp")) {
  const world = block.nextElementSibling;
  if (!world?.matches(".language-json")) continue;
  const open = made("button", { type: "button", class: "live-open" }, "Run and change it here");
  world.after(open);
  open.addEventListener("click", () => {
    const { trace, ...given } = JSON.parse(world.querySelector("code").textContent); // what must come of it stays above
    openEditor(open, block.querySelector("code").textContent, JSON.stringify(given, null, 2));
    open.remove();
  });
}
