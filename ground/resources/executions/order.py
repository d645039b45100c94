"""What the job that executes a package on a training rover is given."""

from __future__ import annotations

from mission import Sky
from mission.codec import Codec, Document
from mission.values import value


@value
class Signer:
    """A public key (base64) of a person, and the roles in which it counts."""

    person: str
    public: str
    roles: tuple[str, ...]


@value
class ExecutionWork:
    """A package to be executed.

    Parameters
    ----------
    counter
        The package's own; its run has a folder of this name.
    rover_dir
        Folder of the training rover: ledger, trust file, root key and the runs of its packages.
    package_path, run_dir, files_dir, terrain_dir
        The package; where the run's folder is kept; the file store; the terrain.
    problem, rover_profile, sky
        What the world of the rover is made of.
    signers
        Whose signatures its trust file takes: read anew whenever a worker takes the job up.
    """

    run_id: str
    mission: str
    counter: int
    rover_dir: str
    package_path: str
    run_dir: str
    files_dir: str
    terrain_dir: str
    problem: Document
    rover: str
    seed: int
    rover_profile: str
    sky: Sky
    signers: tuple[Signer, ...]


ORDERS = Codec(ExecutionWork, "execution-order/1", "order for an execution")
