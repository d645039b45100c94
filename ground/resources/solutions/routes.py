"""Endpoints: localization solutions."""

from __future__ import annotations

from starlette.responses import Response

from ground.api.context import Asked, Id, IfMatch, SiteNumber, answer, created
from ground.api.etags import revision_wanted
from ground.api.problems import responses
from ground.api.resource_routes import resource_routes
from ground.resources.solutions.bodies import FrameFileImport, SolutionChoice, SolutionCreate
from ground.resources.solutions.choose_solution import GivenSolution, add_solution
from ground.resources.solutions.choose_solution import choose_solution as choose_solution_use_case
from ground.resources.solutions.frame_files import export_frames as export_frames_use_case
from ground.resources.solutions.frame_files import import_frames as import_frames_use_case
from ground.resources.solutions.kind import FRAME_FILE, SOLUTION
from ground.resources.solutions.value import Carried, FrameFile, Solution

router = resource_routes(
    SOLUTION,
    "frames",
    lists="List every solution there ever was, of one frame if wanted; the oldest first.",
    reads="Read a solution.",
    changes="Change the notes of a solution; what it says of its frame never changes.",
)
files = resource_routes(FRAME_FILE, "frames", lists="List the missions' frame files that were taken in.")
router.routes.extend(files.routes)


@router.put(
    "/frames/{frame_id}/solution",
    response_model=Carried,
    responses=responses(400, 404, 409, 412, 422, 428),
)
async def choose_solution(
    ask: Asked, frame_id: Id, body: SolutionChoice, if_match: IfMatch = None
) -> Response:
    """Put a solution of a frame in use, and carry along the targets, keep-outs and maps that it moves.

    With `preview` nothing is changed and the answer says what would be; no If-Match is needed then.
    """
    revision = None if body.preview else revision_wanted(if_match)
    return answer(
        await ask.do(
            choose_solution_use_case,
            frame_id,
            body.solution_id,
            revision,
            preview=body.preview,
            reason=body.reason,
        )
    )


@router.post(
    "/frames/{frame_id}/solutions",
    response_model=Solution,
    status_code=201,
    responses=responses(400, 404, 409, 422),
)
async def create_solution(ask: Asked, frame_id: Id, body: SolutionCreate) -> Response:
    """Add a solution to a frame; it is kept for good, and in use once it is chosen."""
    value = await ask.do(add_solution, frame_id, GivenSolution(**body.model_dump()))
    return created(value, f"/api/v1/solutions/{value.id}")


@router.post(
    "/missions/{mission_id}/frame-files",
    response_model=FrameFile,
    status_code=201,
    responses=responses(400, 404, 409, 422),
)
async def import_frames(ask: Asked, mission_id: Id, body: FrameFileImport) -> Response:
    """Take in an uploaded frame file (.svf, .rvf): all its frames and solutions, or none.

    What is here already is not taken in twice, and no frame that has a solution in use gets another.
    """
    return answer(await ask.do(import_frames_use_case, mission_id, body.upload_id), 201)


@router.get(
    "/missions/{mission_id}/frame-files/export",
    response_class=Response,
    responses={
        200: {"content": {"application/xml": {"schema": {"type": "string"}}}},
        **responses(404, 422),
    },
)
async def export_frames(ask: Asked, mission_id: Id, site: SiteNumber = None) -> Response:
    """Send all sites as a frame file (.svf), or with `site` the rover poses within it (.rvf)."""
    name, content = await ask.do(export_frames_use_case, mission_id, site=site)
    headers = {"Content-Disposition": f'attachment; filename="{name}"'}
    return Response(content, media_type="application/xml", headers=headers)
