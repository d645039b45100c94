/** Short names for what the server gives out; the shapes come from its OpenAPI document. */

import type { components } from "./schema";

export type Schemas = components["schemas"];

export type Approval = Schemas["Approval"];
export type CameraView = Schemas["CameraView"];
export type ConstraintKind = Schemas["ConstraintKind"];
export type Comment = Schemas["Comment"];
export type Event = Schemas["Event"];
export type Finding = Schemas["Finding"];
export type FlightRuleResult = Schemas["FlightRuleResult"];
export type Job = Schemas["Job"];
export type KeepOut = Schemas["KeepOut"];
export type Lineage = Schemas["Lineage"];
export type Mission = Schemas["Mission"];
export type MissionCreate = Schemas["MissionCreate"];
export type ObservationRequest = Schemas["ObservationRequest"];
export type ObservationRequestCreate = Schemas["ObservationRequestCreate"];
export type ObservationRequestChange = Schemas["ObservationRequestChange"];
export type Panorama = Schemas["Panorama"];
export type PathNetwork = Schemas["PathNetwork"];
export type Person = Schemas["Person"];
export type Plan = Schemas["Plan"];
export type PlanCreate = Schemas["PlanCreate"];
export type Pose = Schemas["Pose"];
export type Product = Schemas["Product"];
export type Rover = Schemas["Rover"];
export type RoverInstrument = Schemas["RoverInstrument"];
export type RoverShape = Schemas["RoverShape"];
export type Run = Schemas["Run"];
export type RunCreate = Schemas["RunCreate"];
export type Sol = Schemas["Sol"];
export type SolChange = Schemas["SolChange"];
export type SigningKey = Schemas["SigningKey"];
export type StandCheck = Schemas["StandCheck"];
export type Statement = Schemas["Statement"];
export type Target = Schemas["Target"];
export type TargetChange = Schemas["TargetChange"];
export type Telemetry = Schemas["Telemetry"];
export type Terrain = Schemas["Terrain"];
export type TerrainPoint = Schemas["TerrainPoint"];
export type Trace = Schemas["Trace"];
export type PlanComparison = Schemas["PlanComparison"];
export type WhyNot = Schemas["WhyNot"];
export type WhatIfAnswer = Schemas["WhatIfAnswer"];
export type RunControl = Schemas["RunControl"];
export type RunSnapshot = Schemas["RunSnapshot"];
