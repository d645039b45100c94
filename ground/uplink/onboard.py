"""The program of the on-board file, `outcrop-onboard.pyz`: execute, stop, ask, check.

Standard library and `cryptography` alone; `scripts/build-onboard` packs it with all that it imports.
"""

from __future__ import annotations

import argparse
import errno
import json
import logging
import sys
from collections.abc import Sequence
from pathlib import Path

PROGRAM = "outcrop-onboard"
SUCCEEDED, ENDED_OTHERWISE, REFUSED = 0, 1, 2
DEFECT, TRY_AGAIN = 70, 75
"""EX_SOFTWARE and EX_TEMPFAIL of sysexits.h: a supervisor should begin again with `--resume`."""
PASSING = frozenset(
    (errno.ENOSPC, errno.EDQUOT, errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.EAGAIN, errno.EIO)
)
"""Errors of the system that may be over a little later."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Return the exit status.

    0 if the plan succeeded or the wish was met, 1 if the plan ended otherwise, 2 if refused, 70 if this
    program is wrong, 75 if what failed may be mended by trying again: no rover answers, a disk is full.
    """
    from executive.crl import CrlError
    from executive.errors import ExecutiveError
    from ground.errors import GroundError

    given = _parser().parse_args(arguments)
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(message)s")
    try:
        return int(given.act(given))
    except (GroundError, ExecutiveError, CrlError) as err:
        sys.stderr.write(f"{PROGRAM}: {err}\n")
        return TRY_AGAIN if _may_pass(err) else REFUSED
    except OSError as err:
        sys.stderr.write(f"{PROGRAM}: {err.filename or 'a file'}: {err.strerror or err}\n")
        return TRY_AGAIN if _may_pass(err) else REFUSED
    except Exception:
        logging.getLogger(PROGRAM).exception("a defect of this program")
        return DEFECT


def _may_pass(error: BaseException | None) -> bool:
    """Tell whether what failed may be over a little later: the line to the rover, or a full disk."""
    from executive.errors import WireError

    while error is not None:
        if isinstance(error, WireError) or (isinstance(error, OSError) and error.errno in PASSING):
            return True
        error = error.__cause__
    return False


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog=PROGRAM, description=__doc__.partition("\n")[0])
    verbs = parser.add_subparsers(required=True, metavar="VERB")
    execute = verbs.add_parser("execute", help="execute a package on the rover that listens")
    execute.add_argument("package", type=Path)
    execute.add_argument("--connect", required=True, help="unix:/path or tcp://host:port")
    execute.add_argument("--world", type=Path, required=True, help="folder of the rover's ledger")
    execute.add_argument("--trust", type=Path, required=True, help="trust file: whose signatures count")
    execute.add_argument("--out", type=Path, required=True, help="folder of the run")
    execute.add_argument("--resume", action="store_true", help="go on with a run, or begin it")
    execute.add_argument("--silence", type=float, default=60.0, help="seconds before the rover is made safe")
    execute.add_argument("--dictionary", type=Path, help="dictionary/1 of a rover that does not tell its own")
    for name in ("cert", "key", "ca"):
        execute.add_argument(f"--{name}", type=Path, help="mutual TLS (PEM)")
    execute.set_defaults(act=_execute)
    stop = verbs.add_parser("stop", help="stop a live run and its rover at once")
    stop.add_argument("run", type=Path)
    stop.set_defaults(act=_stop)
    ask = verbs.add_parser("ask", help="hold, go, step, abort or state of a live run")
    ask.add_argument("what", choices=["hold", "go", "step", "abort", "state"])
    ask.add_argument("run", type=Path)
    ask.set_defaults(act=_ask)
    check = verbs.add_parser("check", help="say whether a package would be accepted by a trust file")
    check.add_argument("package", type=Path)
    check.add_argument("--trust", type=Path, required=True)
    check.set_defaults(act=_check)
    return parser


def _execute(given: argparse.Namespace) -> int:
    from executive.crl.dictionary import load_dictionary
    from executive.errors import WireError
    from executive.runtime.wire.address import Address, Keys
    from ground.errors import InvalidInputError
    from ground.uplink.live import LiveOptions, LivePlace, execute_live

    language = None if given.dictionary is None else load_dictionary(given.dictionary)
    named = None if language is None else (language.name, language.version, language.sha256)
    try:
        keys = Keys.of(given.cert, given.key, given.ca)
        address = Address.parse(given.connect)
        address.require_keys(keys)
    except WireError as err:  # no line was tried: these words stay wrong
        raise InvalidInputError(str(err)) from None
    place = LivePlace(address, given.world, given.trust, keys, named)
    package, flight = execute_live(
        given.package,
        place,
        given.out,
        resume=given.resume,
        options=LiveOptions(silence_s=given.silence),
        on_repair=logging.getLogger(PROGRAM).warning,
    )
    run = flight.outcome
    sys.stdout.write(
        f"package {package.counter} of {package.mission}: {run.outcome or 'unfinished'} "
        f"after {run.end_s or 0.0:.0f} s, {len(run.products)} products in {given.out}\n"
    )
    return SUCCEEDED if run.outcome == "SUCCEEDED" else ENDED_OTHERWISE


def _stop(given: argparse.Namespace) -> int:
    from ground.uplink.live import stop_run

    sys.stdout.write(stop_run(given.run) + "\n")
    return 0


def _ask(given: argparse.Namespace) -> int:
    from executive.runtime.control import ask_run

    sys.stdout.write(json.dumps(ask_run(given.run, {"m": given.what})) + "\n")
    return 0


def _check(given: argparse.Namespace) -> int:
    from ground.uplink.admission import utc_now
    from ground.uplink.trust import checked, read_file, refusals
    from ground.uplink.verify import verify_package

    trust = checked(read_file(given.trust, "the trust file"))
    with refusals():
        package = verify_package(read_file(given.package, "the package"), trust, utc_now())
    sys.stdout.write(f"package {package.counter} of {package.mission} would be accepted\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
