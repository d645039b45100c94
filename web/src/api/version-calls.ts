/** What the page asks of versions of plans and missions: differences by meaning, merges, and decisions on drafts. */

import { api, body } from "./client";
import type { components } from "./schema";

type Schemas = components["schemas"];

export type PlanChange = Schemas["Change"];
export type PlanConflict = Schemas["PlanConflict"];
export type PlanMerge = Schemas["PlanMerge"];
export type PlanMergeCreate = Schemas["PlanMergeCreate"];
export type PlanSide = Schemas["PlanSide"];
export type MissionEdit = Schemas["MissionEdit"];
export type MissionConflict = Schemas["MissionConflict"];
export type MissionDifference = Schemas["MissionDifference"];
export type MissionMerge = Schemas["MissionMerge"];
export type MissionMergeCreate = Schemas["MissionMergeCreate"];
export type MissionChoice = Schemas["MissionChoice"];

/** What differs by meaning; parts of the second plan are *added*. */
export const planDifference = (plan_id: string, other_id: string): Promise<Schemas["PlanDifference"]> =>
  body(api.GET("/api/v1/plans/{plan_id}/difference/{other_id}", { params: { path: { plan_id, other_id } } }));

export const mergePlans = (mission_id: string, merge: PlanMergeCreate): Promise<PlanMerge> =>
  body(api.POST("/api/v1/missions/{mission_id}/plan-merges", { params: { path: { mission_id } }, body: merge }));

/** What a mission (`ours`) and another (`theirs`) did since they began to differ. */
export const missionDifference = (mission_id: string, from_id: string): Promise<MissionDifference> =>
  body(api.GET("/api/v1/missions/{mission_id}/difference", { params: { path: { mission_id }, query: { from_id } } }));

export const mergeMissions = (mission_id: string, merge: MissionMergeCreate): Promise<MissionMerge> =>
  body(api.POST("/api/v1/missions/{mission_id}/mission-merges", { params: { path: { mission_id } }, body: merge }));

export const acceptDraft = (draft_id: string): Promise<Schemas["Draft"]> =>
  body(api.POST("/api/v1/drafts/{draft_id}/accept", { params: { path: { draft_id } } }));

export const rejectDraft = (draft_id: string, reason: string): Promise<Schemas["Draft"]> =>
  body(api.POST("/api/v1/drafts/{draft_id}/reject", { params: { path: { draft_id } }, body: { reason } }));
