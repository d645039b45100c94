// Outcrop in Open MCT: missions, plans and runs as objects, with history and live telemetry.
// A page installs it with: openmct.install(OutcropPlugin()). See docs/how-to/flight-projects.md.
(function () {
  "use strict";

  const NAMESPACE = "outcrop";
  const SETTLE_MS = 1300; // a live run tells its link once a second: within that the clocks are compared
  const LEAST_WAIT_MS = 1000; // before a server that is away is asked again, then twice as long each time
  const MOST_WAIT_MS = 30000;
  const QUANTILES = { predicted_low: 0.05, predicted_median: 0.5, predicted_high: 0.95 };
  const COLOURS = { navigate: "#3a7bd5", observe: "#2a9d8f", visit: "#2a9d8f", track_start: "#b08900" };

  const MEASURES = {
    battery_j: { name: "Battery", units: "J" },
    energy_used_j: { name: "Energy used", units: "J" },
    predicted_low: { name: "Energy predicted, 5 %", units: "J", predicted: true },
    predicted_median: { name: "Energy predicted, median", units: "J", predicted: true },
    predicted_high: { name: "Energy predicted, 95 %", units: "J", predicted: true },
    east_m: { name: "East", units: "m" },
    north_m: { name: "North", units: "m" },
    heading_rad: { name: "Heading", units: "rad" },
    task: { name: "Task", text: true },
    states: { name: "Activity states", states: true },
  };

  /** Whether a planner made it, so that it has a plan tree and a prediction; a merged or edited one has text alone. */
  const predicted = (plan) => Boolean(plan.crl_sha256) && plan.expected_utility !== null;

  const identifier = (key) => ({ namespace: NAMESPACE, key });

  /** An answer that is none; one that will be the same the next time is `final`. */
  function refusal({ status }, path) {
    const error = new Error(`Outcrop answers ${status} to ${path}`);
    return Object.assign(error, { final: status >= 400 && status < 500 && status !== 429 });
  }

  /** Tries `act(again)` until it is done, refused for good or `signal` aborts; `again` says that it goes well. */
  async function persist(signal, act) {
    let wait = LEAST_WAIT_MS;
    while (!signal.aborted) {
      try {
        if (await act(() => (wait = LEAST_WAIT_MS))) return;
      } catch (error) {
        if (signal.aborted) return;
        console.warn(`Outcrop: ${error.message}`);
        if (error.final) return;
      }
      const now = wait;
      await new Promise((resolve) => setTimeout(resolve, now));
      wait = Math.min(2 * wait, MOST_WAIT_MS);
    }
  }

  /** REST and event streams of one Outcrop. */
  class Client {
    constructor({ url = "", key = "", person = "" }) {
      this.base = `${url.replace(/\/$/, "")}/api/v1`;
      this.headers = {};
      if (key) this.headers.Authorization = `Bearer ${key}`;
      if (person) this.headers["X-Outcrop-Person"] = person;
    }

    async get(path) {
      const answer = await fetch(this.base + path, { headers: this.headers, credentials: "same-origin" });
      if (!answer.ok) throw refusal(answer, path);
      return answer.json();
    }

    /** All of a list, page by page. */
    async list(path) {
      const items = [];
      let cursor = null;
      do {
        const page = await this.get(cursor === null ? path : `${path}?cursor=${encodeURIComponent(cursor)}`);
        items.push(...page.items);
        cursor = page.next_cursor;
      } while (cursor !== null);
      return items;
    }

    /** Calls `heard(event, data, id)` for each event behind `last` until the stream ends or `signal` aborts. */
    async listen(path, signal, last, heard) {
      const headers = { ...this.headers, Accept: "text/event-stream" };
      if (last) headers["Last-Event-ID"] = last;
      const answer = await fetch(this.base + path, { headers, signal, credentials: "same-origin" });
      if (!answer.ok) throw refusal(answer, path);
      const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
      let text = "";
      for (;;) {
        const { done, value } = await reader.read();
        if (done) return;
        const parts = (text + value).split("\n\n");
        text = parts.pop();
        for (const part of parts) {
          const lines = part.split("\n");
          const event = lines.find((l) => l.startsWith("event: "))?.slice(7);
          const data = lines.find((l) => l.startsWith("data: "))?.slice(6);
          const id = lines.find((l) => l.startsWith("id: "))?.slice(4);
          if (event && data) heard(event, JSON.parse(data), id);
        }
      }
    }
  }

  /** One run: its place in time, its states, and whoever listens to it. */
  class Feed {
    constructor(client, run) {
      this.client = client;
      this.run = run;
      this.over = !["queued", "running"].includes(run.state);
      this.states = [];
      this.listeners = new Set();
      this.pace = 1;
      this.begin = Date.parse(run.created_utc);
      this.waiting = [];
      this.placed = this.over ? Promise.resolve() : this.place();
    }

    utc(t_s) {
      return Math.round(this.begin + (1000 * t_s) / this.pace);
    }

    /** Follows the stream; the earliest that a message can have been sent tells when the plan began. */
    place() {
      let least = Infinity;
      this.settled = false;
      const { signal } = new AbortController(); // a feed is followed until the run ends or the page is left
      let last = "";
      const heard = (event, data, id) => {
        last = id ?? last;
        if (event === "control" && data.pace > 0) this.pace = data.pace;
        if (typeof data?.t_s === "number") least = Math.min(least, Date.now() - (1000 * data.t_s) / this.pace);
        if (event === "end") this.over = true;
        if (event !== "telemetry" && event !== "trace") return;
        if (this.settled) this.tell(event, data);
        else this.waiting.push([event, data]);
      };
      persist(signal, async (again) => {
        await this.client.listen(`/runs/${this.run.id}/events`, signal, last, (...told) => {
          again();
          heard(...told);
        });
        return this.over;
      });
      return new Promise((resolve) => {
        const settle = () => {
          if (least === Infinity && !this.over) return void setTimeout(settle, 100);
          if (least !== Infinity) this.begin = least;
          this.settled = true;
          for (const [event, data] of this.waiting.splice(0)) this.tell(event, data);
          resolve();
        };
        setTimeout(settle, SETTLE_MS);
      });
    }

    tell(event, data) {
      if (event === "trace") {
        const state = this.state(data);
        if (!state) return;
        this.states.push(state);
        data = state;
      }
      for (const listener of this.listeners) listener(event, data);
    }

    /** A record of the trace as a state of an activity; null for what says nothing of one. */
    state({ t_s, event, arguments: about }) {
      if (event !== "start" && event !== "end") return null;
      const state = event === "start" ? "in progress" : String(about[1] ?? "ended").toLowerCase();
      return { utc: this.utc(t_s), activity: String(about[0]), state };
    }

    async history(measure) {
      await this.placed;
      if (measure === "states") {
        if (!this.over) return [...this.states];
        const trace = await this.client.get(`/runs/${this.run.id}/trace`);
        return trace.events.map((e) => this.state(e)).filter(Boolean);
      }
      if (measure in QUANTILES) return this.predicted(measure);
      const table = await this.client.get(`/runs/${this.run.id}/telemetry`);
      return table.t_s
        .map((t_s, k) => ({ utc: this.utc(t_s), value: table[measure][k] }))
        .filter((datum) => datum.value !== null);
    }

    async predicted(measure) {
      const tree = await this.client.get(`/plans/${this.run.plan_id}/tree`);
      return band(tree.plan, QUANTILES[measure]).map(({ t_s, value }) => ({ utc: this.utc(t_s), value }));
    }

    listen(measure, callback) {
      const listener = (event, data) => {
        if (measure === "states") {
          if (event === "trace") callback(data);
        } else if (event === "telemetry" && data[measure] !== null && data[measure] !== undefined) {
          callback({ utc: this.utc(data.t_s), value: data[measure] });
        }
      };
      this.listeners.add(listener);
      return () => this.listeners.delete(listener);
    }
  }

  /** Energy used at each step of the main line: the median of its time, a quantile of its energy. */
  function band(steps, quantile) {
    return steps
      .filter((step) => step.quantiles)
      .map(({ quantiles }) => ({
        t_s: quantiles.time_s[quantiles.p.indexOf(0.5)],
        value: quantiles.energy_j[quantiles.p.indexOf(quantile)],
      }));
  }

  /** A plan tree in the form of Open MCT's plan: a group for the main line and one for each option. */
  function planBody(tree, utc, names) {
    const groups = {};
    const waiting = [["main line", tree.plan, 0]];
    while (waiting.length) {
      const [group, steps, from_s] = waiting.shift();
      let at = from_s;
      const starts = steps.map((step) => (at = step.quantiles ? median(step) : at));
      groups[group] = [];
      steps.forEach((step, k) => {
        if (step.op === "branch") {
          step.options.forEach((o, n) => waiting.push([o.id ?? `option ${n + 1}`, o.plan, starts[k]]));
          return;
        }
        const end = k + 1 < starts.length ? starts[k + 1] : starts[k] + (names.duration_s.get(step.observation) ?? 1);
        const place = step.target ?? step.to ?? "";
        const about = [names.target.get(place) ?? place, names.instrument.get(step.observation)].filter(Boolean).join(", ");
        groups[group].push({
          id: `${group} ${k}`,
          name: `${step.op} ${about}`.trim(),
          type: step.op,
          start: utc(starts[k]),
          end: utc(Math.max(end, starts[k] + 1)),
          color: COLOURS[step.op] ?? "#777777",
          textColor: "#ffffff",
        });
      });
    }
    return groups;
  }

  /** What people call the targets of a problem, and of each observation the instrument and how long it takes. */
  function namesOf({ targets = [] }) {
    const observations = targets.flatMap((target) => target.observations ?? []);
    return {
      target: new Map(targets.map(({ id, refs }) => [id, refs?.name ?? id])),
      instrument: new Map(observations.map(({ id, instrument }) => [id, instrument])),
      duration_s: new Map(observations.map(({ id, observe }) => [id, observe?.time_s?.mean])),
    };
  }

  const median = ({ quantiles }) => quantiles.time_s[quantiles.p.indexOf(0.5)];

  /** Objects, composition and telemetry of one Outcrop. */
  class Source {
    constructor(client) {
      this.client = client;
      this.feeds = new Map();
      this.kept = new Map(); // what a person changed of a view, until the page is left
    }

    feed(id) {
      if (!this.feeds.has(id)) {
        const made = this.client.get(`/runs/${id}`).then((run) => new Feed(this.client, run));
        made.catch(() => this.feeds.delete(id));
        this.feeds.set(id, made);
      }
      return this.feeds.get(id);
    }

    async get({ key }) {
      if (this.kept.has(key)) return this.kept.get(key);
      const [kind, id, part] = key.split(".");
      const object = await this[kind](id, part);
      return { identifier: identifier(key), location: "ROOT", ...object };
    }

    missions() {
      return { name: "Outcrop", type: "outcrop.folder" };
    }

    async mission(id) {
      const { name } = await this.client.get(`/missions/${id}`);
      return { name, type: "outcrop.folder", location: `${NAMESPACE}:missions` };
    }

    async plan(id) {
      const plan = await this.client.get(`/plans/${id}`);
      const sol = await this.client.get(`/sols/${plan.sol_id}`);
      const begin = Date.parse(sol.start_utc ?? plan.created_utc);
      return this.planObject(plan, (t_s) => begin + 1000 * t_s, `${NAMESPACE}:mission.${plan.mission_id}`);
    }

    async planObject(plan, utc, location) {
      const tree = await this.client.get(`/plans/${plan.id}/tree`);
      const { document } = await this.client.get(`/problems/${plan.problem_id}`);
      const body = planBody(tree, utc, namesOf(document));
      const name = plan.name || `Plan ${plan.number}`;
      return { name, type: "plan", location, selectFile: { body }, configuration: { clipActivityNames: true } };
    }

    async run(id, part) {
      const feed = await this.feed(id);
      const { run } = feed;
      const location = `${NAMESPACE}:run.${id}`;
      if (part === "plan") {
        await feed.placed;
        return this.planObject(await this.client.get(`/plans/${run.plan_id}`), (t_s) => feed.utc(t_s), location);
      }
      if (part === "energy") {
        const energies = ["energy_used_j", ...Object.keys(QUANTILES)];
        const drawn = (await this.parts(id)).filter((m) => energies.includes(m)).map((m) => identifier(`run.${id}.${m}`));
        const series = drawn.map((one) => ({ identifier: one }));
        const configuration = { series, objectStyles: {}, yAxis: {}, additionalYAxes: [] };
        return { name: "Energy, predicted and used", type: "telemetry.plot.overlay", composition: drawn, configuration, location };
      }
      if (part) return { ...measureObject(part), location };
      const name = `Run ${run.kind} on ${run.rover}, seed ${run.seed}`;
      return { name, type: "outcrop.folder", location: `${NAMESPACE}:mission.${run.mission_id}` };
    }

    /** What there is of a run: nothing predicted where its plan has no prediction. */
    async parts(id) {
      const { run } = await this.feed(id);
      const all = ["plan", "energy", ...Object.keys(MEASURES)];
      if (predicted(await this.client.get(`/plans/${run.plan_id}`))) return all;
      return all.filter((part) => part !== "plan" && !MEASURES[part]?.predicted);
    }

    async update(object) {
      this.kept.set(object.identifier.key, object);
      return true;
    }

    async create(object) {
      return this.update(object);
    }

    async load(object) {
      const [kind, id] = object.identifier.key.split(".");
      if (kind === "missions") {
        return (await this.client.list("/missions")).map((m) => identifier(`mission.${m.id}`));
      }
      if (kind === "run") return (await this.parts(id)).map((m) => identifier(`run.${id}.${m}`));
      const plans = (await this.client.list(`/missions/${id}/plans`)).filter(predicted);
      const runs = await this.client.list(`/missions/${id}/runs`);
      return [...plans.map((p) => identifier(`plan.${p.id}`)), ...runs.map((r) => identifier(`run.${r.id}`))];
    }
  }

  function measureObject(key) {
    const measure = MEASURES[key];
    const time = { key: "utc", source: "utc", name: "Time", format: "utc", hints: { domain: 1 } };
    const text = (name, range) => ({ key: name, source: name, name, format: "string", hints: { range } });
    let values = [{ key: "value", source: "value", name: measure.name, units: measure.units, format: "float", hints: { range: 1 } }];
    if (measure.text) values = [{ ...text("value", 1), name: measure.name }];
    if (measure.states) values = [text("activity", 1), text("state", 2)];
    return { name: measure.name, type: "outcrop.measure", telemetry: { values: [time, ...values] } };
  }

  /** Returns the plug-in; `url` of Outcrop (this page's own by default), and an API `key` or a `person`. */
  function OutcropPlugin(options = {}) {
    const source = new Source(new Client(options));
    const ours = (object) => object.identifier.namespace === NAMESPACE;
    const parts = (object) => object.identifier.key.split(".");

    return function install(openmct) {
      openmct.types.addType("outcrop.folder", { name: "Outcrop", description: "Missions and runs of Outcrop", cssClass: "icon-folder" });
      openmct.types.addType("outcrop.measure", { name: "Telemetry of a run", description: "A value that a run tells", cssClass: "icon-telemetry" });
      openmct.objects.addRoot(identifier("missions"), openmct.priority.HIGH);
      openmct.objects.addProvider(NAMESPACE, source);
      openmct.composition.addProvider({
        appliesTo: (object) => ours(object) && object.type === "outcrop.folder",
        load: (object) => source.load(object),
      });
      openmct.telemetry.addProvider({
        supportsRequest: (object) => ours(object) && object.type === "outcrop.measure",
        supportsSubscribe: (object) => ours(object) && object.type === "outcrop.measure" && !MEASURES[parts(object)[2]].predicted,
        async request(object, { start, end, size, strategy } = {}) {
          const [, run, measure] = parts(object);
          const all = await (await source.feed(run)).history(measure);
          const found = all.filter(({ utc }) => (start === undefined || utc >= start) && (end === undefined || utc <= end));
          return strategy === "latest" ? found.slice(-(size ?? 1)) : found;
        },
        subscribe(object, callback) {
          const [, run, measure] = parts(object);
          let stop = () => {};
          const controller = new AbortController();
          persist(controller.signal, async () => {
            const feed = await source.feed(run);
            if (!controller.signal.aborted) stop = feed.listen(measure, callback);
            return true;
          });
          return () => {
            controller.abort();
            stop();
          };
        },
      });
    };
  }

  window.OutcropPlugin = OutcropPlugin;
})();
