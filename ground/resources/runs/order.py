"""What the job that runs a plan on a simulated rover is given."""

from __future__ import annotations

from ground.uplink.link import Link
from mission import Sky
from mission.codec import Codec, Document
from mission.values import NotNegative, value


@value
class SentCommand:
    """A command of the operator, and when it leaves the ground."""

    operation: str
    sent_s: float


@value
class RunWork:
    """A plan to be run.

    Parameters
    ----------
    run_dir, files_dir, terrain_dir
        Folders of the run, of the file store and of the terrain.
    problem
        The planning problem (`problem/1` or `problem/2`), from which a rover draws its world.
    rover_profile, sky
        What the rover is that is simulated, and where the sun stands at the start.
    faults
        Each a `fault/1`.
    pace
        Plan seconds a second; 0 is as fast as it goes.
    rover_profile
        Name of the rover profile, or the path of one; orders before it was kept were K9's.
    link
        Light time and passes; None where ground hears all at once.
    """

    run_id: str
    run_dir: str
    files_dir: str
    terrain_dir: str
    crl_text: str
    problem: Document
    rover: str
    seed: int
    faults: tuple[Document, ...] = ()
    pace: NotNegative = 0.0
    link: Link | None = None
    commands: tuple[SentCommand, ...] = ()
    rover_profile: str = "k9"
    sky: Sky = Sky()


ORDERS = Codec(RunWork, "run-order/1", "order for a run", upgrades={"": ("run-order/1", dict)})
