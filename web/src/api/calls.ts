/** What the page asks of the server, one function a call. Nothing else in the page knows an address. */

import type { CoverageGrid } from "../lib/overlay";
import type { Grid } from "../lib/terrain-image";
import type { CampaignResult, RunFilter } from "../lib/campaign";
import type { PlanTree } from "../lib/plan-tree";
import { api, body, ifMatch, pages, ProblemError, sendFile, setCsrf } from "./client";
import { ownKey, sha256, sign } from "../lib/signing";
import type { components } from "./schema";
import type {
  ApiKey,
  Approval,
  Campaign,
  CampaignCreate,
  CameraView,
  Comment,
  Draft,
  FaultBody,
  Event,
  Finding,
  FlightRuleResult,
  FlownRuns,
  Job,
  KeepOut,
  Lineage,
  Looker,
  Mission,
  ObservationRequest,
  ObservationRequestChange,
  ObservationRequestCreate,
  OpenSession,
  Panorama,
  PathNetwork,
  Person,
  Plan,
  PlanComparison,
  PlanCreate,
  Pose,
  Product,
  Rover,
  RoverShape,
  Run,
  RunControl,
  RunCreate,
  RunSnapshot,
  ServiceStatus,
  Sol,
  SolChange,
  StandCheck,
  Statement,
  Target,
  TargetChange,
  Telemetry,
  Terrain,
  TerrainPoint,
  Trace,
  WhatIfAnswer,
  WhyNot,
} from "./types";

const V1 = "/api/v1";
const PAGE = 500;
type Schemas = components["schemas"];
type SessionValue = Schemas["SessionValue"];

const inMission = (mission_id: string) => ({ path: { mission_id } });
const inMissionPage = (mission_id: string, cursor: string | undefined, crs: string | null = null) => ({
  path: { mission_id },
  query: { limit: PAGE, ...(cursor === undefined ? {} : { cursor }), ...(crs === null ? {} : { crs }) },
});
const pageOnly = (cursor: string | undefined) => ({
  query: cursor === undefined ? { limit: PAGE } : { limit: PAGE, cursor },
});

// --------------------------------------------------------------------------------------------- people

export async function session(): Promise<SessionValue> {
  const value = await body(api.GET("/api/v1/session"));
  setCsrf(value.csrf_token);
  return value;
}

export async function logIn(name: string, password = ""): Promise<SessionValue> {
  const value = await body(api.POST("/api/v1/session", { body: { name, password } }));
  setCsrf(value.csrf_token);
  return value;
}

export const beFirst = (token: string, name: string, password: string): Promise<unknown> =>
  body(api.POST("/api/v1/first-administrator", { body: { token, name, password } }));

export const logOut = (): Promise<unknown> => body(api.DELETE("/api/v1/session"));

export const operations = (): Promise<ServiceStatus> => body(api.GET("/api/v1/operations"));

export const changePassword = (old: string, changed: string): Promise<unknown> =>
  body(api.PUT("/api/v1/session/password", { body: { old, new: changed } }));

export const openSessions = (everyone: boolean): Promise<OpenSession[]> =>
  body(api.GET("/api/v1/sessions", { params: { query: { everyone } } }));

export const endSession = (session_id: string): Promise<unknown> =>
  body(api.DELETE("/api/v1/sessions/{session_id}", { params: { path: { session_id } } }));

export const apiKeys = (everyone: boolean): Promise<ApiKey[]> =>
  body(api.GET("/api/v1/api-keys", { params: { query: { everyone } } }));

export const makeApiKey = (key: Schemas["ApiKeyCreate"]): Promise<Schemas["NewApiKey"]> =>
  body(api.POST("/api/v1/api-keys", { body: key }));

export const deleteApiKey = (key_id: string): Promise<unknown> =>
  body(api.DELETE("/api/v1/api-keys/{key_id}", { params: { path: { key_id } } }));

export const people = (): Promise<Person[]> =>
  pages((cursor) => body(api.GET("/api/v1/people", { params: pageOnly(cursor) })));

export const createPerson = (value: Schemas["PersonCreate"]): Promise<Person> => body(api.POST("/api/v1/people", { body: value }));

export const changePerson = (person: Person, changes: Schemas["PersonChange"]): Promise<Person> =>
  body(api.PATCH("/api/v1/people/{person_id}", { params: { path: { person_id: person.id }, header: ifMatch(person) }, body: changes }));

export const resetPassword = (person: Person, password: string): Promise<unknown> =>
  body(api.PUT("/api/v1/people/{person_id}/password", { params: { path: { person_id: person.id } }, body: { password } }));

// -------------------------------------------------------------------------------------------- missions

export const missions = (): Promise<Mission[]> =>
  pages((cursor) => body(api.GET("/api/v1/missions", { params: pageOnly(cursor) })));

export const mission = (id: string): Promise<Mission> =>
  body(api.GET("/api/v1/missions/{mission_id}", { params: inMission(id) }));

export const createMission = (value: Schemas["MissionCreate"]): Promise<Mission> =>
  body(api.POST("/api/v1/missions", { body: value }));

export const copyMission = (id: string, name: string): Promise<Mission> =>
  body(api.POST("/api/v1/missions/{mission_id}/copy", { params: inMission(id), body: { name, notes: "" } }));

export const changesUrl = (mission: string): string => `${V1}/missions/${mission}/events`;

export const history = (id: string): Promise<Event[]> =>
  body(
    api.GET("/api/v1/missions/{mission_id}/history", {
      params: { path: { mission_id: id }, query: { limit: 60, newest_first: true } },
    }),
  ).then((page) => page.items);

/** Say that somebody looks at a mission on this page; hear who does. */
export const sayPresence = (mission: string, page: string, selected: Schemas["SelectedBody"] | null): Promise<Looker[]> =>
  body(api.PUT("/api/v1/missions/{mission_id}/presence/{page}", { params: { path: { mission_id: mission, page } }, body: { selected } }));

/** Say that nobody looks any more; it goes out although the page is closed. */
export const leavePresence = (mission: string, page: string): Promise<unknown> =>
  body(api.DELETE("/api/v1/missions/{mission_id}/presence/{page}", { params: { path: { mission_id: mission, page } }, keepalive: true }));

export const undo = (id: string): Promise<Event[]> =>
  body(api.POST("/api/v1/missions/{mission_id}/undo", { params: inMission(id), body: { anyone: false } }));

export const redo = (id: string): Promise<Event[]> =>
  body(api.POST("/api/v1/missions/{mission_id}/redo", { params: inMission(id), body: { anyone: false } }));

// --------------------------------------------------------------------------------------------- terrain

export const terrain = (id: string): Promise<Terrain> =>
  body(api.GET("/api/v1/missions/{mission_id}/terrain", { params: inMission(id) }));

export const orthoUrl = (id: string, layer: string, pixels = 4096): string =>
  `${V1}/missions/${id}/terrain/ortho?layer=${encodeURIComponent(layer)}&max_px=${pixels}`;

export const terrainPoint = (id: string, east_m: number, north_m: number): Promise<TerrainPoint> =>
  body(
    api.GET("/api/v1/missions/{mission_id}/terrain/point", {
      params: { path: { mission_id: id }, query: { east_m, north_m } },
    }),
  );

/** Where a point of the site lies in another reference. */
export const coordinates = (id: string, east_m: number, north_m: number, crs: string): Promise<Schemas["PointIn"]> =>
  body(api.GET("/api/v1/missions/{mission_id}/coordinates", { params: { path: { mission_id: id }, query: { east_m, north_m, crs } } }));

interface RasterAnswer extends Omit<Grid, "heights"> {
  content: ArrayBuffer;
}

async function raster(id: string, what: string, layer: string, posts: number): Promise<RasterAnswer> {
  const url = `${V1}/missions/${id}/terrain/${what}?layer=${encodeURIComponent(layer)}&max_posts=${posts}`;
  const answer = await fetch(url, { credentials: "same-origin" });
  if (!answer.ok) throw new ProblemError(answer.status, { title: `The ${what} of the terrain could not be read` });
  const numbers = (name: string): number[] => (answer.headers.get(name) ?? "").split(",").map(Number);
  const [rows = 0, columns = 0] = numbers("X-Outcrop-Shape");
  const [west = 0, south = 0, east = 0, north = 0] = numbers("X-Outcrop-Bounds");
  return { rows, columns, west, south, east, north, content: await answer.arrayBuffer() };
}

/** Heights of a layer, thinned out to at most `posts`. */
export async function heights(id: string, layer: string, posts: number): Promise<Grid> {
  const { content, ...grid } = await raster(id, "heights", layer, posts);
  return { ...grid, heights: new Float32Array(content) };
}

/** What the mast sees from the start pose, and how well. */
export async function coverage(id: string, layer: string, posts: number): Promise<CoverageGrid> {
  const { content, ...grid } = await raster(id, "coverage", layer, posts);
  return { ...grid, codes: new Uint8Array(content) };
}

// ----------------------------------------------------------------------------------- rover and panorama

/** What a rover carries and may be asked, by the name of its profile. */
export const roverProfile = (name: string): Promise<Rover> => body(api.GET("/api/v1/rovers/{name}", { params: { path: { name } } }));

export const rover = (id: string): Promise<RoverShape> =>
  body(api.GET("/api/v1/missions/{mission_id}/rover", { params: inMission(id) }));

/** A camera of the rover at a pose, site frame; the mast looks at a point of the ground or stands at two angles. */
export const cameraView = (
  id: string,
  pose: Pose,
  camera: string,
  mast: { pan_rad: number; tilt_rad: number } | { at_east_m: number; at_north_m: number },
): Promise<CameraView> =>
  body(
    api.GET("/api/v1/missions/{mission_id}/rover/view", {
      params: {
        path: { mission_id: id },
        query: { east_m: pose.east_m, north_m: pose.north_m, heading_rad: pose.heading_rad, camera, ...mast },
      },
    }),
  );

export const panorama = (id: string): Promise<Panorama> =>
  body(api.GET("/api/v1/missions/{mission_id}/panorama", { params: inMission(id) }));

export const panoramaPoint = (id: string, azimuth_rad: number, elevation_rad: number): Promise<TerrainPoint> =>
  body(
    api.GET("/api/v1/missions/{mission_id}/panorama/point", {
      params: { path: { mission_id: id }, query: { azimuth_rad, elevation_rad } },
    }),
  );

/** Whether a request can be carried out from a pose. */
export const standCheck = (request: string, pose: Pose): Promise<StandCheck> =>
  body(
    api.GET("/api/v1/observation-requests/{observation_request_id}/stand", {
      params: { path: { observation_request_id: request }, query: { ...pose } },
    }),
  );

// -------------------------------------------------------------------------------------------- uploads

/** Send a file; `told` hears the share that is sent, 0 to 1. */
export const upload = (
  file: File,
  told: (share: number) => void,
  stop: AbortSignal,
): Promise<Schemas["Upload"]> =>
  sendFile(`${V1}/uploads?file_name=${encodeURIComponent(file.name)}`, file, told, stop) as Promise<Schemas["Upload"]>;

// ------------------------------------------------------------------------------------- sols and targets

export const sols = (id: string): Promise<Sol[]> =>
  pages((cursor) => body(api.GET("/api/v1/missions/{mission_id}/sols", { params: inMissionPage(id, cursor) })));

export const changeMission = (mission: Mission, changes: Schemas["MissionChange"]): Promise<Mission> =>
  body(
    api.PATCH("/api/v1/missions/{mission_id}", {
      params: { path: { mission_id: mission.id }, header: ifMatch(mission) },
      body: changes,
    }),
  );

/** The kind of the job that learns a mission's calibration from its runs. */
export const CALIBRATE = "calibrate_mission";

export const calibrateMission = (id: string): Promise<Job> =>
  body(
    api.POST("/api/v1/missions/{mission_id}/calibrate", { params: inMission(id), body: { run_ids: [], name: "" } }),
  );

/** Execute an uplinked plan on the training rover of its mission. */
export const EXECUTE = "execution";

export const executePlan = (id: string, rover: string): Promise<Job> =>
  body(api.POST("/api/v1/plans/{plan_id}/execution", { params: planPath(id), body: { rover, seed: 1 } }));

/** Take in the folder of a run that came down from a rover, a zip. */
export async function ingestRun(file: File, told: (share: number) => void, stop: AbortSignal): Promise<Run> {
  const sent = await upload(file, told, stop);
  return body(api.POST("/api/v1/runs/ingest", { body: { upload_id: sent.id } }));
}

/** Open the sol after an execution. */
export const openNextSol = (run: string): Promise<Sol> =>
  body(api.POST("/api/v1/runs/{run_id}/next-sol", { params: runPath(run) }));

export const changeSol = (sol: Sol, changes: SolChange): Promise<Sol> =>
  body(
    api.PATCH("/api/v1/sols/{sol_id}", { params: { path: { sol_id: sol.id }, header: ifMatch(sol) }, body: changes }),
  );

export const targets = (id: string, crs: string | null = null): Promise<Target[]> =>
  pages((cursor) => body(api.GET("/api/v1/missions/{mission_id}/targets", { params: inMissionPage(id, cursor, crs) })));

export const createTarget = (
  id: string,
  name: string,
  east_m: number,
  north_m: number,
  source_image = "",
): Promise<Target> =>
  body(
    api.POST("/api/v1/missions/{mission_id}/targets", {
      params: inMission(id),
      body: { name, east_m, north_m, notes: "", source_image },
    }),
  );

/** A target at coordinates that were typed, in a reference; null for site metres. */
export const createTargetAt = (id: string, name: string, [x, y]: readonly [number, number], crs: string | null): Promise<Target> =>
  body(
    api.POST("/api/v1/missions/{mission_id}/targets", {
      params: inMission(id),
      body: { name, notes: "", source_image: "", ...(crs === null ? { east_m: x, north_m: y } : { at: { crs, x, y } }) },
    }),
  );

export const changeTarget = (target: Target, changes: TargetChange): Promise<Target> =>
  body(
    api.PATCH("/api/v1/targets/{target_id}", {
      params: { path: { target_id: target.id }, header: ifMatch(target) },
      body: changes,
    }),
  );

export const deleteTarget = (target: Target): Promise<unknown> =>
  body(
    api.DELETE("/api/v1/targets/{target_id}", {
      params: { path: { target_id: target.id }, header: ifMatch(target) },
    }),
  );

export const targetLineage = (id: string): Promise<Lineage> =>
  body(api.GET("/api/v1/targets/{target_id}/lineage", { params: { path: { target_id: id } } }));

export const requests = (id: string): Promise<ObservationRequest[]> =>
  pages((cursor) =>
    body(api.GET("/api/v1/missions/{mission_id}/observation-requests", { params: inMissionPage(id, cursor) })),
  );

export const createRequest = (id: string, value: ObservationRequestCreate): Promise<ObservationRequest> =>
  body(api.POST("/api/v1/missions/{mission_id}/observation-requests", { params: inMission(id), body: value }));

/** Many requests made, changed and deleted as one act: all of them, or none. */
export const bulkRequests = (id: string, rows: Schemas["ObservationRequestBulk"]): Promise<Schemas["BulkDone"]> =>
  body(api.POST("/api/v1/missions/{mission_id}/observation-requests/bulk", { params: inMission(id), body: rows }));

export const changeRequest = (
  request: ObservationRequest,
  changes: ObservationRequestChange,
): Promise<ObservationRequest> =>
  body(
    api.PATCH("/api/v1/observation-requests/{observation_request_id}", {
      params: { path: { observation_request_id: request.id }, header: ifMatch(request) },
      body: changes,
    }),
  );

export const deleteRequest = (request: ObservationRequest): Promise<unknown> =>
  body(
    api.DELETE("/api/v1/observation-requests/{observation_request_id}", {
      params: { path: { observation_request_id: request.id }, header: ifMatch(request) },
    }),
  );

export const keepOuts = (id: string, crs: string | null = null): Promise<KeepOut[]> =>
  pages((cursor) => body(api.GET("/api/v1/missions/{mission_id}/keep-outs", { params: inMissionPage(id, cursor, crs) })));

export const createKeepOut = (id: string, name: string, polygon_m: number[][]): Promise<KeepOut> =>
  body(
    api.POST("/api/v1/missions/{mission_id}/keep-outs", { params: inMission(id), body: { name, notes: "", polygon_m } }),
  );

export const changeKeepOut = (keepOut: KeepOut, changes: Schemas["KeepOutChange"]): Promise<KeepOut> =>
  body(
    api.PATCH("/api/v1/keep-outs/{keep_out_id}", {
      params: { path: { keep_out_id: keepOut.id }, header: ifMatch(keepOut) },
      body: changes,
    }),
  );

export const deleteKeepOut = (keepOut: KeepOut): Promise<unknown> =>
  body(
    api.DELETE("/api/v1/keep-outs/{keep_out_id}", {
      params: { path: { keep_out_id: keepOut.id }, header: ifMatch(keepOut) },
    }),
  );

// ------------------------------------------------------------------------------------------- comments

export const comments = (id: string): Promise<Comment[]> =>
  pages((cursor) => body(api.GET("/api/v1/missions/{mission_id}/comments", { params: inMissionPage(id, cursor) })));

export const createComment = (id: string, value: Schemas["CommentCreate"]): Promise<Comment> =>
  body(api.POST("/api/v1/missions/{mission_id}/comments", { params: inMission(id), body: value }));

/** Proposals that wait for a decision. */
export const openDrafts = (mission_id: string): Promise<Draft[]> =>
  pages((cursor) => {
    const query = { limit: PAGE, state: "open", ...(cursor === undefined ? {} : { cursor }) };
    return body(api.GET("/api/v1/missions/{mission_id}/drafts", { params: { path: { mission_id }, query } }));
  });

// ------------------------------------------------------------------------------------------- planning

export const networks = (id: string): Promise<PathNetwork[]> =>
  pages((cursor) =>
    body(
      api.GET("/api/v1/missions/{mission_id}/path-networks", {
        params: { path: { mission_id: id }, query: cursor === undefined ? { limit: 20 } : { limit: 20, cursor } },
      }),
    ),
  );

export const createNetwork = (id: string): Promise<Job> =>
  body(api.POST("/api/v1/missions/{mission_id}/path-networks", { params: inMission(id), body: {} }));

export const plans = (id: string): Promise<Plan[]> =>
  pages((cursor) => body(api.GET("/api/v1/missions/{mission_id}/plans", { params: inMissionPage(id, cursor) })));

export const createPlan = (id: string, value: PlanCreate): Promise<Job> =>
  body(api.POST("/api/v1/missions/{mission_id}/plans", { params: inMission(id), body: value }));

const planPath = (plan_id: string) => ({ path: { plan_id } });

export const planTree = async (id: string): Promise<PlanTree> =>
  (await body(api.GET("/api/v1/plans/{plan_id}/tree", { params: planPath(id) }))) as unknown as PlanTree;

/** The best plan so far of a search that goes on. */
export interface PlanDraft {
  number: number;
  found_utc: string;
  value: number;
  upper: number | null;
  branches: number;
  tree: PlanTree;
  network: PathNetwork;
}

export const planDraft = async (id: string): Promise<PlanDraft | null> =>
  (await body(api.GET("/api/v1/plans/{plan_id}/draft", { params: planPath(id) }))) as unknown as PlanDraft | null;

export const planCrl = (id: string): Promise<string> =>
  body(api.GET("/api/v1/plans/{plan_id}/crl", { params: planPath(id), parseAs: "text" }));

/** What the validator has against a text, as if it were an edit of the plan. */
export const checkCrl = (id: string, crl: string): Promise<Schemas["CrlFinding"][]> =>
  body(api.POST("/api/v1/plans/{plan_id}/crl-check", { params: planPath(id), body: { crl } }));

export const editPlan = (id: string, crl: string, name: string): Promise<Plan> =>
  body(api.POST("/api/v1/plans/{plan_id}/edits", { params: planPath(id), body: { crl, notes: "", ...(name === "" ? {} : { name }) } }));

export const planFindings = (id: string): Promise<Finding[]> =>
  body(api.GET("/api/v1/plans/{plan_id}/findings", { params: planPath(id) }));

export const planSummary = (id: string): Promise<Schemas["SummaryDocument"]> =>
  body(api.GET("/api/v1/plans/{plan_id}/summary", { params: planPath(id) }));

export const whyNot = (id: string, request_id: string): Promise<WhyNot> =>
  body(api.GET("/api/v1/plans/{plan_id}/why-not/{request_id}", { params: { path: { plan_id: id, request_id } } }));

export const comparePlans = (id: string, other_id: string): Promise<PlanComparison> =>
  body(api.GET("/api/v1/plans/{plan_id}/comparison/{other_id}", { params: { path: { plan_id: id, other_id } } }));

export const whatIf = (id: string, changes: Schemas["WhatIf"]): Promise<WhatIfAnswer> =>
  body(api.POST("/api/v1/plans/{plan_id}/what-if", { params: planPath(id), body: changes }));

export const flightRules = (id: string): Promise<FlightRuleResult[]> =>
  body(api.GET("/api/v1/plans/{plan_id}/flight-rules", { params: planPath(id) }));

export const waiveRule = (id: string, rule: string, reason: string): Promise<FlightRuleResult[]> =>
  body(api.POST("/api/v1/plans/{plan_id}/waivers", { params: planPath(id), body: { rule, reason } }));

export const approvals = (id: string): Promise<Approval[]> =>
  pages((cursor) => body(api.GET("/api/v1/missions/{mission_id}/approvals", { params: inMissionPage(id, cursor) })));

export type Role = "author" | "verifier" | "approver";

/** What was made to be signed of a plan, with its signatures; null if nothing was. */
export const statement = (id: string): Promise<Statement | null> =>
  body(api.GET("/api/v1/plans/{plan_id}/statement", { params: planPath(id) }));

/** The canonical text of a plan, over which its digest is taken. */
const canonicalCrl = (id: string): Promise<string> =>
  body(api.GET("/api/v1/plans/{plan_id}/crl", { params: { ...planPath(id), query: { canonical: true } }, parseAs: "text" }));

/** Sign a plan in one's roles with the key of this browser, if its text is the one with the digest that was read. */
export async function signPlan(id: string, crl: string, person: string, roles: readonly Role[], note: string): Promise<Statement> {
  const key = await ownKey(person);
  let found = await body(api.POST("/api/v1/plans/{plan_id}/statement", { params: planPath(id) }));
  const manifest = JSON.parse(found.manifest) as { crl_sha256: string; author: string; verification: { verifier: string } };
  const text = await sha256(new TextEncoder().encode(await canonicalCrl(id)));
  if (text !== crl || manifest.crl_sha256 !== crl) throw new Error("The text of the plan is not the one that is shown here.");
  const proof = await sign(key, "signing-key/1", "owner", person);
  await body(api.POST("/api/v1/signing-keys", { body: { public: key.public, proof, name: "browser" } }));
  const who = { author: manifest.author, verifier: manifest.verification.verifier, approver: person };
  const own = roles.filter((role) => who[role] === person);
  for (const role of own) {
    const signature = await sign(key, "package/2", role, found.manifest);
    const signed = { role, sha256: found.sha256, key: key.id, signature, note };
    found = await body(api.POST("/api/v1/plans/{plan_id}/signatures", { params: planPath(id), body: signed }));
  }
  return found;
}

/** The uplink package of what people signed; what is given back is a file to save. */
export const uplinkPackage = (id: string): Promise<Blob> =>
  body(api.POST("/api/v1/plans/{plan_id}/package", { params: planPath(id), parseAs: "blob" })) as Promise<Blob>;

// ------------------------------------------------------------------------------------------------ jobs

export const jobs = (id: string): Promise<Job[]> =>
  pages((cursor) => body(api.GET("/api/v1/missions/{mission_id}/jobs", { params: inMissionPage(id, cursor) })));

export const job = (id: string): Promise<Job> => body(api.GET("/api/v1/jobs/{job_id}", { params: { path: { job_id: id } } }));

export const cancelJob = (id: string): Promise<Job> =>
  body(api.POST("/api/v1/jobs/{job_id}/cancel", { params: { path: { job_id: id } } }));

export const jobEventsUrl = (id: string): string => `${V1}/jobs/${id}/events`;

const JOB_TITLES: Record<string, string> = { plan: "Planning", path_network: "Path network", run: "Dry run" };

const OTHER_TITLES: Record<string, string> = {
  [CALIBRATE]: "Learning from runs", [EXECUTE]: "Executing", import_recording: "Taking in a recording", live: "Live run",
};

export const jobTitle = (value: Job): string =>
  OTHER_TITLES[value.kind] ?? JOB_TITLES[value.subject_kind] ?? value.kind.replaceAll("_", " ");

// ------------------------------------------------------------------------------------ runs and products

export const runs = (id: string): Promise<Run[]> =>
  pages((cursor) => body(api.GET("/api/v1/missions/{mission_id}/runs", { params: inMissionPage(id, cursor) })));

export const createRun = (id: string, value: RunCreate): Promise<Job> =>
  body(api.POST("/api/v1/missions/{mission_id}/runs", { params: inMission(id), body: value }));

// ----------------------------------------------------------------------------------------- campaigns

export const campaigns = (mission_id: string, plan_id: string): Promise<Campaign[]> =>
  pages((cursor) => {
    const query = { limit: PAGE, plan_id, ...(cursor === undefined ? {} : { cursor }) };
    return body(api.GET("/api/v1/missions/{mission_id}/campaigns", { params: { path: { mission_id }, query } }));
  });

export const createCampaign = (mission_id: string, order: CampaignCreate): Promise<Job> =>
  body(api.POST("/api/v1/missions/{mission_id}/campaigns", { params: inMission(mission_id), body: order }));

export const campaignResult = (campaign_id: string): Promise<CampaignResult> =>
  body(api.GET("/api/v1/campaigns/{campaign_id}/result", { params: { path: { campaign_id } } })) as unknown as Promise<CampaignResult>;

export const campaignRuns = (campaign_id: string, { low, high, option, task }: RunFilter): Promise<FlownRuns> =>
  body(api.GET("/api/v1/campaigns/{campaign_id}/runs", { params: { path: { campaign_id }, query: { low, high, option, task } } }));

export const campaignReportUrl = (id: string): string => `${V1}/campaigns/${id}/report`;
export const campaignTableUrl = (id: string): string => `${V1}/campaigns/${id}/runs.csv`;

const runPath = (run_id: string) => ({ path: { run_id } });

export const run = (id: string): Promise<Run> => body(api.GET("/api/v1/runs/{run_id}", { params: runPath(id) }));

export const trace = (id: string): Promise<Trace> =>
  body(api.GET("/api/v1/runs/{run_id}/trace", { params: runPath(id) }));

export const telemetry = (id: string): Promise<Telemetry> =>
  body(api.GET("/api/v1/runs/{run_id}/telemetry", { params: runPath(id) }));

export const controlRun = (id: string, wish: Schemas["RunControlBody"]): Promise<RunControl> =>
  body(api.POST("/api/v1/runs/{run_id}/control", { params: runPath(id), body: wish }));

export const injectFault = (id: string, value: FaultBody): Promise<Run> =>
  body(api.POST("/api/v1/runs/{run_id}/faults", { params: runPath(id), body: value }));

/** The executive as it stood at a plan time. */
export const snapshot = (id: string, t_s: number): Promise<RunSnapshot> =>
  body(api.GET("/api/v1/runs/{run_id}/snapshot", { params: { path: { run_id: id }, query: { t_s } } }));

export const runEventsUrl = (id: string): string => `${V1}/runs/${id}/events`;

export const products = (id: string): Promise<Product[]> =>
  pages((cursor) => body(api.GET("/api/v1/missions/{mission_id}/products", { params: inMissionPage(id, cursor) })));

export const productLineage = (id: string): Promise<Lineage> =>
  body(api.GET("/api/v1/products/{product_id}/lineage", { params: { path: { product_id: id } } }));

export async function productText(product: Product): Promise<string> {
  const answer = await fetch(product.file_url, { credentials: "same-origin" });
  if (!answer.ok) throw new ProblemError(answer.status, { title: `${product.file_name} could not be read` });
  return answer.text();
}

/** Pages that load nothing, for the uplink meeting and for the archive. */
export const planReportUrl = (id: string): string => `${V1}/plans/${id}/report`;
export const runReportUrl = (id: string): string => `${V1}/runs/${id}/report`;
export const planCrlUrl = (id: string): string => `${V1}/plans/${id}/crl`;
