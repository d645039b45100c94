/** What the page asks of the server about the site chain: frames, solutions, maps, traverses. */

import { api, body, ifMatch, pages } from "./client";
import type { Schemas } from "./types";

export type Frame = Schemas["Frame"];
export type Solution = Schemas["Solution"];
export type SiteMap = Schemas["SiteMap"];
export type Carried = Schemas["Carried"];
export type Traverse = Schemas["Traverse"];

const PAGE = 500;
const page = (mission_id: string, cursor: string | undefined) => ({
  path: { mission_id },
  query: cursor === undefined ? { limit: PAGE } : { limit: PAGE, cursor },
});

export const siteMaps = (mission: string): Promise<SiteMap[]> =>
  pages((cursor) => body(api.GET("/api/v1/missions/{mission_id}/site-maps", { params: page(mission, cursor) })));

export const traverses = (mission: string): Promise<Traverse[]> =>
  pages((cursor) => body(api.GET("/api/v1/missions/{mission_id}/traverses", { params: page(mission, cursor) })));

export const frame = (id: string): Promise<Frame> =>
  body(api.GET("/api/v1/frames/{frame_id}", { params: { path: { frame_id: id } } }));

/** Every solution there ever was of a frame, the oldest first. */
export const solutionsOf = (found: Frame): Promise<Solution[]> =>
  body(
    api.GET("/api/v1/missions/{mission_id}/solutions", {
      params: { path: { mission_id: found.mission_id }, query: { frame_id: found.id, limit: PAGE } },
    }),
  ).then((answer) => answer.items);

/** Put a solution in use; as a preview nothing changes, and the answer says what would move. */
export const chooseSolution = (found: Frame, solution: string, preview: boolean): Promise<Carried> =>
  body(
    api.PUT("/api/v1/frames/{frame_id}/solution", {
      params: { path: { frame_id: found.id }, header: ifMatch(found) },
      body: { solution_id: solution, preview, reason: "" },
    }),
  );

export const pictureUrl = (traverse: string, stop: number): string => `/api/v1/traverses/${traverse}/pictures/${stop}`;
