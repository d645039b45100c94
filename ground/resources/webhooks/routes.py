"""Webhooks: servers elsewhere that are told of a mission's events."""

from __future__ import annotations

from starlette.responses import Response

from ground.api.context import Asked, Id, answer, created
from ground.api.problems import responses
from ground.api.resource_routes import resource_routes
from ground.resources.webhooks import create_webhook as hooks
from ground.resources.webhooks.bodies import Redelivery, WebhookCreate
from ground.resources.webhooks.kind import WEBHOOK
from ground.resources.webhooks.value import Deliveries, Delivery, NewSecret

router = resource_routes(
    WEBHOOK,
    "webhooks",
    lists="List the webhooks of a mission.",
    reads="Read a webhook; its secret is not told.",
    changes="Change a webhook: where it leads, of which kinds it is told, or whether it sends.",
    deletes="Delete a webhook.",
)


@router.post(
    "/missions/{mission_id}/webhooks",
    response_model=NewSecret,
    status_code=201,
    responses=responses(400, 404, 409, 422),
)
async def create_webhook(ask: Asked, mission_id: Id, body: WebhookCreate) -> Response:
    """Make a webhook, which is told of what happens from now on; the secret is shown this once."""
    value = await ask.do(hooks.create_webhook, mission_id, body)
    return created(value, f"/api/v1/webhooks/{value.id}")


@router.post("/webhooks/{webhook_id}/secret", response_model=NewSecret, responses=responses(404, 422))
async def rotate_webhook_secret(ask: Asked, webhook_id: Id) -> Response:
    """Give a webhook a new secret, shown this once; for a day the one before signs too."""
    return answer(await ask.do(hooks.rotate_secret, webhook_id))


@router.get("/webhooks/{webhook_id}/deliveries", response_model=Deliveries, responses=responses(404, 422))
async def list_webhook_deliveries(ask: Asked, webhook_id: Id) -> Response:
    """List the last deliveries of a webhook, the newest event first."""
    return answer(await ask.do(hooks.list_deliveries, webhook_id))


@router.post(
    "/webhooks/{webhook_id}/redeliver", response_model=Delivery, responses=responses(400, 404, 409, 422)
)
async def redeliver_webhook(ask: Asked, webhook_id: Id, body: Redelivery) -> Response:
    """Have an event sent once more."""
    return answer(await ask.do(hooks.redeliver, webhook_id, body))
