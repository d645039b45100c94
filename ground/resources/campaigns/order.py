"""What the job that flies a campaign is given."""

from __future__ import annotations

from mission import Sky
from mission.codec import Codec, Document
from mission.values import value


@value
class CampaignWork:
    """A campaign to be flown into `folder`; other members as in `RunWork` and `CampaignCreate`."""

    folder: str
    terrain_dir: str
    crl_text: str
    problem: Document
    rover: str
    rover_profile: str
    seed: int
    runs: int
    help_runs: int = 0
    until_se: float | None = None
    expected_utility: float | None = None
    sky: Sky = Sky()


ORDERS = Codec(CampaignWork, "campaign-work/1", "order for a campaign")
