// Runs scenarios with the executive of a zip file under Pyodide: node run_scenarios.mjs EXECUTIVE.zip SCENARIOS.json
import { readFileSync } from "node:fs";
import { loadPyodide } from "pyodide";

const [archive, scenarios] = process.argv.slice(2);
const python = await loadPyodide();
python.unpackArchive(new Uint8Array(readFileSync(archive)), "zip", { extractDir: "/outcrop" });
python.globals.set("documents", readFileSync(scenarios, "utf8"));
process.stdout.write(
  python.runPython(`
import json, sys
sys.path.insert(0, "/outcrop")
from executive.runtime.scenario import parse_scenario, run_scenario

def came_of_it(name, document):
    run = run_scenario(parse_scenario(document, name))
    return {**run.to_json(), "differences": run.differences}

json.dumps({name: came_of_it(name, document) for name, document in json.loads(documents).items()})
`),
);
