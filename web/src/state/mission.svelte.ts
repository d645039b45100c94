/** One open mission: what the server holds of it, kept current by its event stream, and what the page derives. */

import * as calls from "../api/calls";
import { ProblemError } from "../api/client";
import { listen, type Stream } from "../api/stream";
import type {
  Comment,
  Draft,
  Event,
  Finding,
  Job,
  KeepOut,
  Mission,
  ObservationRequest,
  PathNetwork,
  Plan,
  PlanCreate,
  Product,
  Rover,
  RoverInstrument,
  RoverShape,
  Run,
  RunCreate,
  Selected,
  Sol,
  SolChange,
  Statement,
  Target,
  Terrain,
} from "../api/types";
import { crsOf } from "../lib/coordinates";
import { type CrlNode, nodesOf } from "../lib/crl";
import { withRule } from "../lib/drives";
import { inUnits, words } from "../lib/format";
import { liveRunsOf } from "../lib/live";
import { type Leg, type Line, legsOf, linesOf, type PlanTree, reachOf, type Step } from "../lib/plan-tree";
import type { Marks, Names } from "../lib/plan-versions";
import { bandOf, reasonsOf, type Band } from "../lib/planning";
import type { Selection } from "../lib/route";
import { app } from "./app.svelte";
import { PresenceState } from "./presence.svelte";
import type { WhatIfState } from "./what-if.svelte";

const RELOAD_MS = 120;
/** Until the page reads its lists though nobody tells it yet what changes; a connection stands within some 50 ms. */
const LISTEN_MS = 2000;
/** A list is read when nothing of it changed for so long: an act on 500 rows is told row by row. */
const CALM_MS = 60;
/** But it does not wait for calm longer than this. */
const RELOAD_MOST_MS = 1000;
/** Between two looks at the best plan so far: it is drawn within 0.3 s after it was found. */
const DRAFT_MS = 80;
/** Ids of the server: three letters for the kind, and 13 of chance. */
const IDS = /\b(req|tgt|run|pln)-[0-9a-z]{13}\b/g;
const ACTIVE = new Set(["queued", "running"]);

/** What a selection means for the other views. */
export interface Focus {
  target: string | null;
  request: string | null;
  step: string | null;
  line: string | null;
  product: string | null;
  keepOut: string | null;
  task: string | null;
}

/** The open plan as it differs from another one. */
export interface Against {
  plan: string;
  other: Plan;
  marks: Marks;
  /** What only the other plan has, in words. */
  gone: readonly string[];
}

/** A better plan that was found while the search goes on. */
export interface Found {
  at_s: number;
  value: number;
  upper: number | null;
}

/** A list that is to be read soon. */
interface Pending {
  timer: ReturnType<typeof setTimeout>;
  since: number;
  last: number;
  /** Revisions that were told, by id, null where it went: with all of them here, nothing is read. Null: read anyway. */
  told: Map<string, number | null> | null;
}

const NO_FOCUS: Focus = {
  target: null,
  request: null,
  step: null,
  line: null,
  product: null,
  keepOut: null,
  task: null,
};

/** How a plan came about that no search made: it has a text, and no tree and no prediction. Null for all others. */
export const writtenHow = (plan: Plan): string | null =>
  ({ merged: "merged from others", edited: "edited by hand" })[plan.strategy] ?? null;

export class MissionState {
  mission = $state.raw<Mission | null>(null);
  terrain = $state.raw<Terrain | null>(null);
  /** Shape, cameras and light; null until the server has told them. */
  rover = $state.raw<RoverShape | null>(null);
  /** What it carries and what requests may ask of it; null until the server has told that. */
  profile = $state.raw<Rover | null>(null);
  sols = $state.raw<Sol[]>([]);
  targets = $state.raw<Target[]>([]);
  requests = $state.raw<ObservationRequest[]>([]);
  keepOuts = $state.raw<KeepOut[]>([]);
  networks = $state.raw<PathNetwork[]>([]);
  plans = $state.raw<Plan[]>([]);
  runs = $state.raw<Run[]>([]);
  private recorded = $state.raw<Product[]>([]);
  /** Products that a run which goes on has announced; they are recorded, under the same ids, when it is over. */
  private announced = $state.raw<Product[]>([]);
  jobs = $state.raw<Job[]>([]);
  comments = $state.raw<Comment[]>([]);
  /** Proposals of assistants and sentences that wait for a decision. */
  drafts = $state.raw<Draft[]>([]);
  loading = $state(true);
  missing = $state<string | null>(null);

  /** What the next plan is asked for; the plan sheet changes it. */
  order = $state<PlanCreate>({
    notes: "",
    strategy: "optimal",
    max_branches: 8,
    time_limit_s: 20,
    seed: 1,
    request_ids: [],
  });

  /** What is wrong with it; then no plan is asked for. */
  orderProblem = $state("");

  tree = $state.raw<PlanTree | null>(null);
  /** The best plan so far, while the open plan is made. */
  draft = $state.raw<calls.PlanDraft | null>(null);
  /** Values of the better and better plans, by the seconds since the first was seen; the bound where it is known. */
  course = $state.raw<readonly Found[]>([]);
  crl = $state.raw<string | null>(null);
  /** The plan that the text is of: another one may be open already while its own is read. */
  crlOf = $state("");
  findings = $state.raw<Finding[]>([]);
  /** What the planner says of the open plan: why it is empty, or has no branches. */
  reasons = $state.raw<readonly string[]>([]);
  band = $state.raw<Band | null>(null);
  planError = $state<string | null>(null);
  /** The text of a plan as it is being edited; kept while other sheets are open. */
  edit = $state.raw<{ plan: string; text: string } | null>(null);
  /** What is open on the plan sheet beside the plan. */
  asked = $state<"what-if" | "compare" | "merge" | "campaign" | null>(null);
  /** What differs from another plan, marked on outline and timeline; null where nothing is marked. */
  against = $state.raw<Against | null>(null);
  /** The what-if that is being tried; what is dragged on the map then is tried and not saved. */
  tried = $state.raw<WhatIfState | null>(null);

  readonly instruments = $derived<readonly RoverInstrument[]>(this.profile?.instruments ?? []);
  /** Kinds of condition that a request may have. */
  readonly kinds = $derived(this.profile?.constraints ?? []);
  readonly place = $derived(this.mission?.place ?? null);
  /** The reference that coordinates are shown in; null for site metres. */
  readonly crs = $derived(crsOf(app.coordinates, this.place));
  readonly sol = $derived(this.sols[this.sols.length - 1] ?? null);
  /** Where the rover stands when the open plan begins, else when the newest sol does. */
  readonly startPose = $derived(
    (this.sols.find((sol) => sol.id === this.plans.find((plan) => plan.id === app.route.plan)?.sol_id) ?? this.sol)?.start_pose ??
      this.terrain?.start_pose ??
      null,
  );
  readonly startHour = $derived(this.sol?.start_lmst_h ?? 10);
  readonly network = $derived(this.networks[this.networks.length - 1] ?? null);
  readonly plan = $derived(this.plans.find((plan) => plan.id === app.route.plan) ?? null);
  /** The network the open plan was made on. */
  readonly planNetwork = $derived(
    this.draft?.network ?? this.networks.find((network) => network.id === this.plan?.network_id) ?? this.network,
  );
  readonly lines = $derived<Line[]>(this.tree === null ? [] : linesOf(this.tree));
  readonly legs = $derived<Leg[]>(legsOf(this.lines));
  readonly reach = $derived(reachOf(this.lines));
  readonly steps = $derived(
    new Map<string, Step>(this.lines.flatMap((line) => line.steps.map((step) => [step.key, step] as const))),
  );
  readonly products = $derived.by<Product[]>(() => {
    const known = new Set(this.recorded.map((product) => product.id));
    return [...this.recorded, ...this.announced.filter((product) => !known.has(product.id))];
  });
  readonly targetById = $derived(new Map(this.targets.map((target) => [target.id, target])));
  readonly targetByName = $derived(new Map(this.targets.map((target) => [target.name, target])));
  readonly requestById = $derived(new Map(this.requests.map((request) => [request.id, request])));
  readonly requestsOf = $derived(Map.groupBy(this.requests, (request) => request.target_id));
  readonly productsOf = $derived(Map.groupBy(this.products, (product) => product.target_id ?? ""));
  /** Requests that a dry run brought a product for: they stay open, because nothing has come from the rover. */
  readonly rehearsed = $derived.by<ReadonlyMap<string, Run>>(() => {
    const runs = new Map(this.runs.map((run) => [run.id, run]));
    const found = new Map<string, Run>();
    for (const product of this.products) {
      const run = runs.get(product.run_id);
      if (product.request_id !== null && run?.kind === "dry_run") found.set(product.request_id, run);
    }
    return found;
  });
  readonly orphans = $derived(this.products.filter((product) => product.orphan));
  readonly planJobs = $derived(this.jobs.filter((job) => ACTIVE.has(job.state)));
  /** The job that makes the open plan. */
  readonly planJob = $derived(this.jobs.find((job) => job.id === this.plan?.job_id) ?? null);
  /** Why there is no such plan; null while it is being made, and when it is there. */
  readonly planFailure = $derived.by<string | null>(() => {
    const [plan, job] = [this.plan, this.planJob];
    if (plan === null || plan.crl_sha256 !== null || job === null || ACTIVE.has(job.state)) return null;
    if (job.state === "cancelled") return "Cancelled before there was a plan.";
    if (job.state === "succeeded") return null;
    return this.reasonOf(job) || "Planning failed.";
  });
  /** How many comments there are on each step of the open plan that has any. */
  readonly saidOfSteps = $derived.by<ReadonlyMap<string, number>>(() => {
    const said = this.comments.filter((one) => one.subject_kind === "plan" && one.subject_id === app.route.plan);
    const parts = said.flatMap((one) => (one.part === null ? [] : [one.part]));
    return new Map([...Map.groupBy(parts, (part) => part)].map(([part, list]) => [part, list.length]));
  });
  readonly nodes = $derived<CrlNode[]>(this.crl === null ? [] : nodesOf(this.crl));
  readonly nodeById = $derived(new Map(this.nodes.map((node) => [node.id, node])));
  readonly focus = $derived<Focus>(this.focusOf(app.selection));

  readonly presence: PresenceState;
  private stream: Stream | null = null;
  private readonly jobStreams = new Map<string, Stream>();
  private readonly pending = new Map<string, Pending>();
  /** How many reads of a list are under way. */
  private readonly reads = new Map<string, number>();
  private closed = false;
  private planLoaded = "";

  constructor(readonly id: string) {
    this.presence = new PresenceState(id);
  }

  /** Load everything; collections come at once and the page fills as they arrive. */
  async open(): Promise<void> {
    try {
      const [mission, terrain] = await Promise.all([calls.mission(this.id), calls.terrain(this.id)]);
      this.mission = mission;
      this.terrain = terrain;
    } catch (error) {
      this.missing =
        error instanceof ProblemError && error.status === 404
          ? "There is no such mission."
          : error instanceof Error
            ? error.message
            : String(error);
      this.loading = false;
      return;
    }
    void app.attempt("Reading the rover", async () => {
      this.rover = await calls.rover(this.id);
    });
    void app.attempt("Reading what the rover carries", () => this.loadProfile());
    if (this.closed) return;
    await this.listen();
    await this.readAll();
    this.loading = false;
    if (this.closed) return;
    if (this.plan === null && app.route.mission === this.id) {
      const latest = this.plans.findLast((plan) => plan.expected_utility !== null);
      if (latest !== undefined) app.go({ plan: latest.id });
    }
  }

  private async readAll(): Promise<void> {
    await Promise.all(
      ["sol", "target", "observation_request", "keep_out", "path_network", "plan", "run", "product", "job", "comment", "draft"].map(
        (kind) => this.reload(kind),
      ),
    );
  }

  /**
   * Follow what changes from now on; lists are read after this, so that a change falls into one or the other.
   * Where the connection takes long the page does not wait for it, and reads its lists anew once it stands.
   */
  private async listen(): Promise<void> {
    let waited = false;
    let stood = false;
    await new Promise<void>((resolve) => {
      const goOn = (): void => {
        waited = true;
        resolve();
      };
      setTimeout(goOn, LISTEN_MS);
      this.stream = listen(
        calls.changesUrl(this.id),
        {
          change: (data) => this.changed(data),
          job: (data) => this.jobChanged(data as Job),
          presence: (data) => this.presence.take(data),
        },
        (open) => {
          app.connected = open;
          if (open && waited && !stood) void app.attempt("Reading what changed meanwhile", () => this.readAll());
          stood ||= open;
          goOn();
        },
      );
    });
  }

  close(): void {
    this.closed = true;
    this.stream?.close();
    for (const stream of this.jobStreams.values()) stream.close();
    for (const { timer } of this.pending.values()) clearTimeout(timer);
  }

  private changed(data: unknown): void {
    if (typeof data !== "object" || data === null || !("kind" in data)) return;
    const { kind, subject_id: id, action, after } = data as Event;
    this.soon(kind, [id, typeof after?.revision === "number" ? after.revision : null]);
    if (kind === "target" && action !== "create") this.soon("observation_request");
    if (["target", "observation_request", "keep_out", "sol"].includes(kind)) {
      // Whatever was computed from the old state is stale now; the server says which.
      this.soon("path_network");
      this.soon("plan");
    }
    if (kind === "run") this.soon("product");
  }

  /** Read a list when its changes are over; `told` is the id of one and its revision then, null where it went. */
  private soon(kind: string, told: readonly [string, number | null] | null = null): void {
    const now = performance.now();
    const waiting = this.pending.get(kind);
    if (waiting === undefined) {
      const timer = setTimeout(() => this.followUp(kind), RELOAD_MS);
      this.pending.set(kind, { timer, since: now, last: now, told: told === null ? null : new Map([told]) });
      return;
    }
    waiting.last = now;
    if (told === null) waiting.told = null;
    else waiting.told?.set(...told);
  }

  private followUp(kind: string): void {
    const waiting = this.pending.get(kind);
    if (waiting === undefined) return;
    const now = performance.now();
    const reads = (this.reads.get(kind) ?? 0) > 0; // it may bring what was told
    if (reads || (now - waiting.last < CALM_MS && now - waiting.since < RELOAD_MOST_MS)) {
      waiting.timer = setTimeout(() => this.followUp(kind), CALM_MS);
      return;
    }
    this.pending.delete(kind);
    if (waiting.told !== null && [...waiting.told].every(([id, revision]) => this.isHere(kind, id, revision))) return;
    void app.attempt("Following the changes of others", () => this.reload(kind));
  }

  /** Whether what is held of a thing is at least that new. */
  private isHere(kind: string, id: string, revision: number | null): boolean {
    const held = { target: this.targetById, observation_request: this.requestById }[kind];
    if (held === undefined) return false;
    const known = held.get(id);
    return revision === null ? known === undefined : known !== undefined && known.revision >= revision;
  }

  /** Ask for what tells its place; again if the person chose another reference meanwhile. */
  private async inReference<T>(ask: (crs: string | null) => Promise<T>): Promise<T> {
    const { crs } = this;
    const found = await ask(crs);
    return crs === this.crs ? found : this.inReference(ask);
  }

  async reload(kind: string): Promise<void> {
    clearTimeout(this.pending.get(kind)?.timer); // what was to be read soon is read now
    this.pending.delete(kind);
    this.reads.set(kind, (this.reads.get(kind) ?? 0) + 1);
    try {
      await this.read(kind);
    } finally {
      this.reads.set(kind, (this.reads.get(kind) ?? 1) - 1);
    }
  }

  private async read(kind: string): Promise<void> {
    switch (kind) {
      case "mission":
        this.mission = await calls.mission(this.id);
        await this.loadProfile();
        break;
      case "sol":
        this.sols = await calls.sols(this.id);
        break;
      case "target":
        this.targets = await this.inReference((crs) => calls.targets(this.id, crs));
        break;
      case "observation_request":
        this.requests = await calls.requests(this.id);
        break;
      case "keep_out":
        this.keepOuts = await this.inReference((crs) => calls.keepOuts(this.id, crs));
        break;
      case "path_network":
        this.networks = await calls.networks(this.id);
        break;
      case "plan":
      case "approval":
      case "waiver":
        this.plans = await calls.plans(this.id);
        if (this.plan !== null && this.plan.crl_sha256 !== null && this.planLoaded !== this.plan.id) {
          await this.loadPlan();
        }
        break;
      case "run":
        this.runs = await calls.runs(this.id);
        break;
      case "product":
        this.recorded = await calls.products(this.id);
        break;
      case "job":
        this.jobs = await calls.jobs(this.id);
        for (const job of this.jobs) if (ACTIVE.has(job.state)) this.follow(job);
        break;
      case "draft":
        this.drafts = await calls.openDrafts(this.id);
        break;
      case "comment":
        this.comments = await calls.comments(this.id);
        break;
    }
  }

  private async loadProfile(): Promise<void> {
    const name = this.mission?.rover_profile;
    if (name !== undefined && name !== this.profile?.name) this.profile = await calls.roverProfile(name);
  }

  /** An instrument of the mission's rover; a request may name one that this rover lacks. */
  instrument(name: string): RoverInstrument | undefined {
    return this.instruments.find((known) => known.name === name);
  }

  /** Whether all of these requests are made from afar. */
  allRemote(requests: readonly ObservationRequest[]): boolean {
    return requests.length > 0 && requests.every((request) => this.instrument(request.instrument)?.use === "remote");
  }

  /** Take in a product of a run that goes on. */
  announce(product: Product): void {
    this.announced = [...this.announced.filter((known) => known.id !== product.id), product];
  }

  /** Whether a product is only announced: nobody can comment on it or ask where it comes from yet. */
  isAnnounced(product: Product): boolean {
    return !this.recorded.some((known) => known.id === product.id);
  }

  /** Fetch tree, CRL and findings of the plan that is open. */
  async loadPlan(): Promise<void> {
    const plan = this.plan;
    if (plan === null || plan.crl_sha256 === null) {
      const same = plan !== null && plan.id === this.draftOf;
      if (!same) this.dropDraft();
      this.tree = same ? (this.draft?.tree ?? null) : null;
      this.crl = null;
      this.findings = [];
      this.reasons = [];
      this.band = null;
      this.planLoaded = "";
      if (plan !== null) this.watchDraft(plan.id);
      return;
    }
    if (this.planLoaded === plan.id) return;
    this.planLoaded = plan.id;
    this.planError = null;
    if (this.against?.plan !== plan.id) this.against = null;
    try {
      const [tree, crl, findings, summary] = await Promise.all([
        writtenHow(plan) !== null ? null : calls.planTree(plan.id),
        calls.planCrl(plan.id),
        calls.planFindings(plan.id),
        calls.planSummary(plan.id),
      ]);
      if (app.route.plan !== plan.id) return;
      this.dropDraft();
      this.tree = tree;
      this.crl = crl;
      this.crlOf = plan.id;
      this.findings = findings;
      this.reasons = reasonsOf(summary);
      this.band = bandOf(summary);
    } catch (error) {
      this.planLoaded = "";
      this.tree = null;
      this.planError = error instanceof Error ? error.message : String(error);
    }
  }

  private draftOf = "";
  private draftTimer: ReturnType<typeof setTimeout> | null = null;
  private draftSince = 0;

  private dropDraft(): void {
    if (this.draftTimer !== null) clearTimeout(this.draftTimer);
    this.draftTimer = null;
    this.draftOf = "";
    this.draft = null;
    this.course = [];
  }

  /** Draw each better plan while it is sought. */
  private watchDraft(id: string): void {
    if (this.draftTimer !== null && this.draftOf === id) return;
    if (this.draftOf !== id) {
      this.dropDraft();
      this.draftSince = performance.now();
    }
    this.draftOf = id;
    this.draftTimer = setTimeout(() => void this.lookAtDraft(id), DRAFT_MS);
  }

  private async lookAtDraft(id: string): Promise<void> {
    this.draftTimer = null;
    const open = this.plan;
    if (this.closed || this.draftOf !== id || open?.id !== id || open.crl_sha256 !== null) return;
    if (this.planJob !== null && !ACTIVE.has(this.planJob.state)) return;
    try {
      const found = await calls.planDraft(id);
      if (this.draftOf === id && found !== null && found.number !== this.draft?.number) {
        this.draft = found;
        this.tree = found.tree;
        const at_s = (performance.now() - this.draftSince) / 1000;
        this.course = [...this.course, { at_s, value: found.value, upper: found.upper }];
      }
    } catch {
      // The plan itself is read when it is there; a look that fails is tried again.
    }
    if (this.draftOf === id) this.watchDraft(id);
  }

  private jobChanged(job: Job): void {
    if (!job?.id) return;
    const known = this.jobs.some((other) => other.id === job.id);
    this.jobs = known ? this.jobs.map((other) => (other.id === job.id ? job : other)) : [...this.jobs, job];
    if (ACTIVE.has(job.state)) this.follow(job);
    else this.finished(job);
  }

  /** Watch a job to its end. */
  follow(job: Job): void {
    if (this.jobStreams.has(job.id) || this.closed) return;
    const stream = listen(calls.jobEventsUrl(job.id), {
      job: (data) => this.jobChanged(data as Job),
    });
    this.jobStreams.set(job.id, stream);
  }

  private finished(job: Job): void {
    const stream = this.jobStreams.get(job.id);
    if (stream === undefined) return;
    stream.close();
    this.jobStreams.delete(job.id);
    if (job.state !== "succeeded" && job.subject_id === this.draftOf) {
      this.dropDraft();
      this.tree = null;
    }
    if (job.state === "failed") {
      app.toast("bad", `${calls.jobTitle(job)} failed`, this.reasonOf(job));
    }
    for (const kind of ["mission", "path_network", "plan", "run", "product", "observation_request"]) this.soon(kind);
  }

  /** Which target, request, step and task a selection stands for. */
  focusOf(selection: Selection | null): Focus {
    if (selection === null) return NO_FOCUS;
    const { kind, id } = selection;
    switch (kind) {
      case "target":
        return { ...NO_FOCUS, target: id };
      case "request":
        return { ...NO_FOCUS, request: id, target: this.requestById.get(id)?.target_id ?? null };
      case "keep-out":
        return { ...NO_FOCUS, keepOut: id };
      case "product": {
        const product = this.products.find((p) => p.id === id);
        return {
          ...NO_FOCUS,
          product: id,
          target: product?.target_id ?? null,
          request: product?.request_id ?? null,
          task: product?.task_id ?? null,
        };
      }
      case "step": {
        const step = this.steps.get(id);
        return {
          ...NO_FOCUS,
          step: id,
          line: step?.line ?? null,
          target: this.targetOf(step?.target ?? null)?.id ?? null,
          request: step?.request ?? null,
        };
      }
      case "branch":
        return { ...NO_FOCUS, line: id };
      case "task": {
        const metadata = this.nodeById.get(id)?.metadata ?? {};
        return {
          ...NO_FOCUS,
          task: id,
          target: this.targetOf(metadata.target ?? null)?.id ?? null,
          request: metadata.observation ?? metadata.request ?? null,
        };
      }
    }
  }

  /** A target by its id or its name, as plans may hold either. */
  targetOf(key: string | null): Target | null {
    if (key === null) return null;
    return this.targetById.get(key) ?? this.targetByName.get(key) ?? null;
  }

  targetName(key: string | null): string {
    if (key === null) return "";
    return this.targetOf(key)?.name ?? this.requestById.get(key)?.target_name ?? key;
  }

  /** What a task of the plan does, for people: its action and target instead of its id. */
  taskName(id: string): string {
    const node = this.nodeById.get(id);
    if (node === undefined) return this.named(id);
    const target = this.targetOf(node.metadata.target ?? null)?.name ?? this.requestById.get(node.metadata.request ?? "")?.target_name;
    const action = node.action ?? node.kind;
    return target === undefined ? (node.action === null ? this.named(id) : action) : `${action} ${target}`;
  }

  /**
   * What the open plan would be worth if a request's value changed: expected utility is linear in the values, so for
   * the same plan the change is the chance that the request succeeds times the change of its value. Null for tracked
   * requests: the tree says how often the step is reached, not how often its target is still tracked then.
   */
  worthWith(request: ObservationRequest, value: number): number | null {
    const now = this.plan?.expected_utility ?? null;
    const chance = this.reach.get(request.id) ?? 0;
    if (now === null || chance === 0 || request.tracked || this.plan?.stale === true) return null;
    const task = this.nodes.find((node) => node.kind === "task" && node.metadata.request === request.id);
    return now + chance * (task?.probability ?? 1) * (value - request.value);
  }

  /** What a step of the open plan is called: what is done, and of what. */
  stepName(key: string): string {
    const step = this.steps.get(key);
    return step === undefined ? "a step" : `${step.op.replaceAll("_", " ")} ${this.targetName(step.target ?? step.request)}`;
  }

  /** What something that somebody has selected is called. */
  nameOf({ kind, id }: Selected): string {
    switch (kind) {
      case "target":
        return this.targetName(id);
      case "observation_request":
        return this.requestName(id);
      case "keep_out":
        return this.keepOuts.find((known) => known.id === id)?.name ?? "a keep-out";
      case "product":
        return this.named(this.products.find((known) => known.id === id)?.file_name ?? "a product");
      case "run":
        return this.runName(id);
      default:
        return this.planName(id);
    }
  }

  private runName(id: string): string {
    const place = this.runs.findIndex((known) => known.id === id);
    return place < 0 ? "a run" : `run ${place + 1}`;
  }

  private planName(id: string): string {
    const plan = this.plans.find((known) => known.id === id);
    return plan === undefined ? "a plan" : `plan #${plan.number}`;
  }

  /** What a request is called: its target and instrument. */
  requestName(id: string | null): string {
    const request = id === null ? undefined : this.requestById.get(id);
    if (request === undefined) return id ?? "";
    return `${request.target_name} · ${words(request.instrument)}`;
  }

  /** Why a job failed, for people. */
  private reasonOf(job: Job): string {
    const detail = typeof job.problem?.detail === "string" ? job.problem.detail : job.message;
    const text = this.told(detail.replace(/^no plan: /, ""));
    return text.slice(0, 1).toUpperCase() + text.slice(1);
  }

  /** Names for texts about plans; what is gone has none. */
  readonly names: Names = {
    target: (id) => this.targetOf(id)?.name ?? "a deleted target",
    request: (id) => (this.requestById.has(id) ? this.requestName(id) : "a deleted request"),
  };

  /** A text of the server, or of a file, with names in the place of ids. */
  named(text: string): string {
    const { names } = this;
    return text.replace(IDS, (id, kind: string) => {
      if (kind === "req") return names.request(id);
      if (kind === "tgt") return names.target(id);
      if (kind === "run") return this.runName(id);
      return kind === "pln" ? this.planName(id) : id;
    });
  }

  /** A sentence of the server as people write it: with names, times and energies in their units. */
  told(text: string): string {
    return inUnits(this.named(text));
  }

  /** Take back one's own last act, or do it again. */
  async undo(): Promise<void> {
    await this.turn("Undo", calls.undo);
  }

  async redo(): Promise<void> {
    await this.turn("Redo", calls.redo);
  }

  private async turn(title: string, act: (id: string) => Promise<{ kind: string; action: string }[]>): Promise<void> {
    const events = await app.attempt(title, () => act(this.id));
    if (events === null) return;
    for (const kind of new Set(events.map((event) => event.kind))) await this.reload(kind);
    const kinds = [...new Set(events.map((event) => event.kind.replaceAll("_", " ")))].join(", ");
    app.toast("ok", title, kinds === "" ? "" : `${kinds}`);
  }

  /** Delete what is selected, where it can be deleted; undo brings it back. */
  async deleteSelected(): Promise<void> {
    const { target, request, keepOut, product } = this.focus;
    if (product !== null) return;
    if (keepOut !== null) {
      const found = this.keepOuts.find((known) => known.id === keepOut);
      if (found !== undefined) await this.removed("keep_out", () => calls.deleteKeepOut(found));
    } else if (app.selection?.kind === "request" && request !== null) {
      const found = this.requestById.get(request);
      if (found !== undefined) await this.removed("observation_request", () => calls.deleteRequest(found));
    } else if (app.selection?.kind === "target" && target !== null) {
      const found = this.targetById.get(target);
      if (found !== undefined) await this.removed("target", () => calls.deleteTarget(found));
    }
  }

  private async removed(kind: string, act: () => Promise<unknown>): Promise<void> {
    const done = await app.attempt("Deleting", async () => {
      await act();
      return true;
    });
    if (done === true) {
      app.select(null);
      app.toast("ok", `${kind.replaceAll("_", " ")} deleted`, "Ctrl-Z brings it back.");
    }
    await app.attempt("Reading again", async () => {
      await this.reload(kind);
      if (kind === "target") await this.reload("observation_request");
    });
  }

  /** Where the rover stands for a target (null: at the start) in the newest network, else the target itself. */
  placeOf(target: string | null): [number, number] | null {
    const node = this.network?.nodes.find((one) => one.target_id === target);
    const pose = node?.pose ?? (target === null ? this.startPose : this.targetById.get(target)?.position);
    return pose == null ? null : [pose.east_m, pose.north_m];
  }

  /** Forbid a drive (null), give it corners, or leave it to the planner ("free"). */
  async setDrive(from: string | null, to: string, via: number[][] | null | "free"): Promise<void> {
    const mission = this.mission;
    if (mission === null) return;
    const rules = withRule(mission.drive_rules, from, to, via);
    await app.attempt("The drive", () => calls.changeMission(mission, { drive_rules: rules }));
    await app.attempt("Reading the mission", () => this.reload("mission"));
    this.soon("plan");
  }

  /** Change the newest sol; return whether it was. */
  async changeSol(changes: SolChange): Promise<boolean> {
    const sol = this.sol;
    if (sol === null) return false;
    const done = await app.attempt(changes.start_pose === undefined ? "The budget" : "The start pose", () => calls.changeSol(sol, changes));
    await app.attempt("Reading the sol", () => this.reload("sol"));
    this.soon("plan");
    return done !== null;
  }

  /** Ask for a plan and open it when its job is under way. */
  async makePlan(order: PlanCreate): Promise<Job | null> {
    if (this.orderProblem !== "") {
      app.toast("bad", "No plan was asked for", `Overrun risk: ${this.orderProblem}.`);
      return null;
    }
    const from = app.route;
    return await app.attempt("Planning", async () => {
      const job = await calls.createPlan(this.id, order);
      this.jobs = [...this.jobs.filter((other) => other.id !== job.id), job];
      this.follow(job);
      await this.reload("plan");
      if (job.subject_id !== "") app.goOn(from, { plan: job.subject_id, tab: "plan", run: null });
      return job;
    });
  }

  /** Carry out the open plan once on the planner's own model. */
  async rehearse(): Promise<void> {
    if (this.plan !== null) {
      await this.dryRun({ plan_id: this.plan.id, rover: "abstract", seed: this.nextSeed(), faults: [], pace: 0, notes: "" });
    }
  }

  /** Keep an edited text of a plan as a new plan and open that. */
  async saveEdit(plan: Plan, text: string, name: string): Promise<void> {
    const from = app.route;
    await app.attempt("The edited plan", async () => {
      const made = await calls.editPlan(plan.id, text, name);
      if (this.edit?.plan === plan.id) this.edit = null;
      await this.reload("plan");
      app.toast("ok", `Plan #${made.number} is saved`, "A dry run that ends well verifies it; then it goes to review.");
      app.goOn(from, { plan: made.id, run: null, selection: null, tab: "crl" });
    });
  }

  /** Sign the open plan as it is shown here, in each of these roles that the person has. */
  async sign(title: string, roles: readonly calls.Role[], note: string, done: string): Promise<Statement | null> {
    const plan = this.plan;
    const person = app.person?.name;
    if (plan?.crl_sha256 == null || person === undefined) return null;
    const sha = plan.crl_sha256;
    const found = await app.attempt(title, () => calls.signPlan(plan.id, sha, person, roles, note));
    if (found !== null) app.toast("ok", done, "Signed with the key that this browser keeps for you.");
    await this.reload("plan");
    return found;
  }

  /** Run the open plan on a simulated rover and look at it. */
  async dryRun(order: RunCreate): Promise<Job | null> {
    const from = app.route;
    return await app.attempt("The dry run", async () => {
      const job = await calls.createRun(this.id, order);
      this.jobs = [...this.jobs.filter((other) => other.id !== job.id), job];
      this.follow(job);
      await this.reload("run");
      if (job.subject_id !== "") app.goOn(from, { run: job.subject_id, tab: "run" });
      return job;
    });
  }

  /** Fit the odds of drives to the recorded runs, from the next plan on. */
  async learn(): Promise<void> {
    await app.attempt("Learning from runs", async () => {
      const job = await calls.calibrateMission(this.id);
      this.jobs = [...this.jobs.filter((other) => other.id !== job.id), job];
      this.follow(job);
    });
  }

  /** Go back to the odds of the rover's profile. */
  async forget(): Promise<void> {
    const mission = this.mission;
    if (mission === null) return;
    await app.attempt("The odds", () => calls.changeMission(mission, { calibration: null }));
    await app.attempt("Reading the mission", () => this.reload("mission"));
    this.soon("plan");
  }

  async cancel(job: Job): Promise<void> {
    await app.attempt("Cancelling", () => calls.cancelJob(job.id));
  }

  /** Stop every live run of the mission, whatever is looked at; one that waits to begin is cancelled. */
  async stopLive(): Promise<void> {
    const stop = async (run: Run): Promise<void> => {
      const job = this.jobs.find((other) => other.id === run.job_id);
      if (run.state === "queued" && job?.state === "queued") await this.cancel(job);
      else await app.attempt("STOP", () => calls.controlRun(run.id, { stop: true }));
    };
    await Promise.all(liveRunsOf(this.runs).map(stop));
  }

  /** Each dry run of a plan draws another future. */
  nextSeed(): number {
    return 1 + Math.max(0, ...this.runs.filter((run) => run.plan_id === this.plan?.id).map((run) => run.seed));
  }

  nextTargetName(): string {
    const taken = new Set(this.targets.map((target) => target.name));
    let number = this.targets.length + 1;
    while (taken.has(`T${number}`)) number += 1;
    return `T${number}`;
  }
}
