"""The plug-in for Open MCT is served as it is, by a service without a built page too."""

from __future__ import annotations

import json
import subprocess

from ground.app.pages import OPEN_MCT
from tests.ground.conftest import Api


def test_the_plug_in_is_a_script_at_its_own_address(sqlite_api: Api) -> None:
    answer = sqlite_api("GET", "/openmct/outcrop.js", raw=True)
    assert answer.status_code == 200
    assert answer.headers["content-type"].startswith("text/javascript")
    assert answer.headers["cross-origin-resource-policy"] == "same-origin"
    assert answer.content == OPEN_MCT.read_bytes()
    assert b"OutcropPlugin" in answer.content


NODE = """
globalThis.window = globalThis;
const later = setTimeout;
globalThis.setTimeout = (act, ms) => later(act, Math.min(ms, 5));
const told = { waits: [], ids: [], heard: [], asked: [] };
const run = { id: "run-1", state: "running", created_utc: "2026-11-22T10:00:00Z", plan_id: "pln-1" };
const json = (value) => ({ ok: true, json: async () => value });
const sent = (text, cut) => new Response(new ReadableStream({
  start(control) {
    control.enqueue(new TextEncoder().encode(text));
    later(() => (cut ? control.error(new TypeError("cut")) : control.close()), 5);
  },
}));
const event = (id, name, data) => `id: ${id}\\nevent: ${name}\\ndata: ${JSON.stringify(data)}\\n\\n`;
let runs = 0, streams = 0;
globalThis.fetch = async (url, { headers }) => {
  const path = new URL(url).pathname.replace("/api/v1", "");
  if (path === "/missions") {
    const from = Number(new URL(url).searchParams.get("cursor") ?? 0);
    const items = [...Array(100).keys()].map((k) => ({ id: `m${from + k}` })).slice(0, 250 - from);
    return json({ items, next_cursor: from + 100 < 250 ? String(from + 100) : null });
  }
  if (path === "/runs/run-1") {
    if (++runs === 1) throw new TypeError("the server is away");
    return json(run);
  }
  told.ids.push(headers["Last-Event-ID"] ?? "");
  streams += 1;
  if (streams === 1) return sent(event(1, "telemetry", { t_s: 1, battery_j: 10 }), true);
  if (streams === 2) throw new TypeError("the server is away");
  if (streams === 3) return { ok: false, status: 503 };
  if (streams === 4) return sent(event(2, "telemetry", { t_s: 2, battery_j: 9 }), false);
  return sent(event(3, "telemetry", { t_s: 3, battery_j: 8 }) + event(3, "end", {}), false);
};
console.warn = () => {};
require(process.argv[1]);
const made = {};
OutcropPlugin({ url: "http://outcrop" })({
  types: { addType() {} },
  priority: {},
  objects: { addRoot() {}, addProvider() {} },
  composition: { addProvider: (given) => (made.composition = given) },
  telemetry: { addProvider: (given) => (made.telemetry = given) },
});
(async () => {
  const listed = await made.composition.load({ identifier: { key: "missions" } });
  await new Promise((done) => {
    const object = { identifier: { key: "run.run-1.battery_j" } };
    made.telemetry.subscribe(object, ({ value }) => {
      told.heard.push(value);
      if (value === 8) later(done, 50);
    });
  });
  console.log(JSON.stringify({ ...told, streams, listed: listed.map((one) => one.key) }));
})();
"""


def test_the_plug_in_lists_every_page_and_comes_back_when_the_server_was_away() -> None:
    """Run by node with a server of the test: 250 missions in three pages; a stream that is cut four times."""
    done = subprocess.run(
        ["node", "-e", NODE, "--", str(OPEN_MCT)], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["listed"] == [f"mission.m{k}" for k in range(250)]
    assert told["heard"] == [10, 9, 8]
    assert told["ids"] == ["", "1", "1", "1", "2"]
    assert told["streams"] == 5, "a run that has ended is not followed any more"
