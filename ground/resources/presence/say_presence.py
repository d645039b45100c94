"""Say that one looks at a mission, or no longer, and hear who else does."""

from __future__ import annotations

from ground.gdr.notices import tell
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.get_resource import require_mission
from ground.records.lookers import CHANNEL, Looker, Lookers, Selected, Word


def say_presence(
    repo: Repository, actor: Actor, lookers: Lookers, mission_id: str, page_id: str, selected: Selected | None
) -> list[Looker]:
    """Say that the actor looks at a mission on a page of theirs; return who does. Nothing is written."""
    _require_seen(repo, actor, mission_id)
    _say(repo, lookers, Word(mission_id, Looker(page_id, actor.name, selected)))
    return lookers.of(mission_id)


def leave_presence(repo: Repository, actor: Actor, lookers: Lookers, mission_id: str, page_id: str) -> None:
    """Say that the actor looks at a mission no longer on a page of theirs."""
    _require_seen(repo, actor, mission_id)
    _say(repo, lookers, Word(mission_id, Looker(page_id, actor.name, None), gone=True))


def list_presence(repo: Repository, actor: Actor, lookers: Lookers, mission_id: str) -> list[Looker]:
    """Return who looks at a mission now, as far as this server has heard."""
    _require_seen(repo, actor, mission_id)
    return lookers.of(mission_id)


def _require_seen(repo: Repository, actor: Actor, mission_id: str) -> None:
    actor.require(Action.READ, mission_id)
    with repo.database.read() as session:
        require_mission(session, mission_id)


def _say(repo: Repository, lookers: Lookers, word: Word) -> None:
    """Take a word in here, and tell the other servers of the database."""
    lookers.take(word)
    if not repo.database.is_sqlite:
        with repo.database.write() as session:
            tell(session, lookers.text(word), CHANNEL)
