/** Campaigns of the open plan: the one looked at, what its runs say so far, and the runs that were asked for. */

import * as calls from "../api/calls";
import { ProblemError } from "../api/client";
import type { Campaign, CampaignCreate, FlownRun, Job, Plan } from "../api/types";
import type { CampaignResult, RunFilter } from "../lib/campaign";
import { app } from "./app.svelte";

/** Between two looks at a campaign that goes on, milliseconds. */
const LOOK_MS = 700;
const ACTIVE = new Set(["queued", "running"]);

/** What is needed of the open mission. */
interface Jobs {
  readonly id: string;
  readonly jobs: readonly Job[];
  follow(job: Job): void;
}

export class CampaignState {
  all = $state.raw<Campaign[]>([]);
  chosen = $state<string | null>(null);
  result = $state.raw<CampaignResult | null>(null);
  problem = $state<string | null>(null);
  filter = $state.raw<RunFilter | null>(null);
  runs = $state.raw<FlownRun[]>([]);
  total = $state(0);

  readonly campaign = $derived(this.all.find((known) => known.id === this.chosen) ?? null);
  readonly job = $derived.by<Job | null>(() => this.day.jobs.find((job) => job.id === this.campaign?.job_id) ?? null);
  readonly flying = $derived(this.job === null ? ACTIVE.has(this.campaign?.state ?? "") : ACTIVE.has(this.job.state));

  private timer: ReturnType<typeof setTimeout> | null = null;
  private closed = false;

  constructor(
    readonly day: Jobs,
    readonly plan: Plan,
  ) {}

  /** Read the campaigns of the plan and open the last one. */
  async open(): Promise<void> {
    await app.attempt("Reading the campaigns", async () => {
      this.all = await calls.campaigns(this.day.id, this.plan.id);
    });
    const last = this.all.at(-1);
    if (last !== undefined) this.choose(last.id);
  }

  close(): void {
    this.closed = true;
    if (this.timer !== null) clearTimeout(this.timer);
  }

  choose(id: string): void {
    this.chosen = id;
    this.result = null;
    this.problem = null;
    this.filter = null;
    this.runs = [];
    const job = this.campaign;
    if (job !== null && ACTIVE.has(job.state)) void app.attempt("Following the campaign", async () => this.day.follow(await calls.job(job.job_id)));
    void this.look();
  }

  async start(order: CampaignCreate): Promise<void> {
    await app.attempt("The campaign", async () => {
      const job = await calls.createCampaign(this.day.id, order);
      this.day.follow(job);
      this.all = await calls.campaigns(this.day.id, this.plan.id);
      this.choose(job.subject_id);
    });
  }

  async cancel(): Promise<void> {
    const job = this.job;
    if (job !== null) await app.attempt("Cancelling", () => calls.cancelJob(job.id));
  }

  /** List the runs that a filter lets through. */
  async list(filter: RunFilter): Promise<void> {
    const id = this.chosen;
    if (id === null) return;
    this.filter = filter;
    await app.attempt("Reading the runs", async () => {
      const found = await calls.campaignRuns(id, filter);
      if (this.chosen === id && this.filter === filter) [this.runs, this.total] = [found.items, found.total];
    });
  }

  /** Read what the runs say, again and again until the campaign is over. */
  private async look(): Promise<void> {
    const id = this.chosen;
    if (id === null || this.closed) return;
    if (this.timer !== null) clearTimeout(this.timer);
    const over = !this.flying;
    // Nothing has been flown yet while the job says so.
    if (!over && (this.job?.progress ?? 0) === 0) {
      this.timer = setTimeout(() => void this.look(), LOOK_MS);
      return;
    }
    try {
      const found = await calls.campaignResult(id);
      if (this.chosen !== id) return;
      this.result = found;
      this.problem = null;
    } catch (error) {
      if (this.chosen !== id) return;
      // Until the first runs have come in there is nothing to be read.
      if (over || !(error instanceof ProblemError && error.status === 409)) this.problem = error instanceof Error ? error.message : String(error);
    }
    if (over) {
      this.all = await calls.campaigns(this.day.id, this.plan.id).catch(() => this.all);
    } else {
      this.timer = setTimeout(() => void this.look(), LOOK_MS);
    }
  }
}
