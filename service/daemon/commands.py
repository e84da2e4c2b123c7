"""The commands of the daemon's protocol, and what each does."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import asdict, dataclass
from typing import Any, Generic, TypeVar

from pydantic import BaseModel, ValidationError

from config import InputError, Installation
from service.daemon.server import Call, Command
from service.practice.course import PracticeArguments
from service.sessions.calibrate_torque_constant import CalibrateTorqueConstant, CalibrateTorqueConstantArguments
from service.sessions.compare_controllers import CompareArguments, CompareControllers
from service.sessions.conductor import Conductor
from service.sessions.diagnose import DiagnoseArguments, DiagnoseArm
from service.sessions.identify_links import IdentifyLinks, IdentifyLinksArguments
from service.sessions.identify_load import IdentifyLoad, IdentifyLoadArguments
from service.sessions.learn_task import LearnTask, LearnTaskArguments
from service.sessions.practise import Practise
from service.sessions.procedure import Procedure
from service.sessions.run_motion import RunArguments, RunMotion

Arguments = TypeVar("Arguments", bound=BaseModel)


@dataclass(frozen=True)
class SessionKind(Generic[Arguments]):
    """One kind of session: what is asked, and the procedure that does it."""

    arguments: type[Arguments]
    procedure: Callable[[Installation, Arguments], Procedure]


SESSIONS: dict[str, SessionKind[Any]] = {
    "run": SessionKind(RunArguments, RunMotion),
    "identify_links": SessionKind(IdentifyLinksArguments, IdentifyLinks),
    "identify_load": SessionKind(IdentifyLoadArguments, IdentifyLoad),
    "calibrate_torque_constant": SessionKind(CalibrateTorqueConstantArguments, CalibrateTorqueConstant),
    "diagnose": SessionKind(DiagnoseArguments, DiagnoseArm),
    "practise": SessionKind(PracticeArguments, Practise),
    "learn_task": SessionKind(LearnTaskArguments, LearnTask),
    "compare_controllers": SessionKind(CompareArguments, CompareControllers),
}


def commands_of(conductor: Conductor) -> dict[str, Command]:
    """Every command by name. ``status`` and ``follow`` only look; the others move the arm or stop it."""

    async def status(call: Call) -> dict[str, Any]:
        return await _status(conductor)

    async def follow(call: Call) -> dict[str, Any]:
        running = conductor.current
        if running is None:
            raise InputError("follow", "no session has run yet", "start one")
        return await running.follow(call.progress)

    async def stop(call: Call) -> dict[str, Any]:
        await conductor.stop(f"stopped on request of user {call.peer.uid} (process {call.peer.pid})")
        return await _status(conductor)

    async def reset(call: Call) -> dict[str, Any]:
        await asyncio.to_thread(conductor.moving.loop.reset)
        return await _status(conductor)

    return {
        "status": Command(status, looks_only=True),
        "follow": Command(follow, looks_only=True),
        "stop": Command(stop),
        "reset": Command(reset),
        **{name: Command(_conducting(conductor, kind)) for name, kind in SESSIONS.items()},
    }


def _conducting(conductor: Conductor, kind: SessionKind[Any]) -> Callable[[Call], Awaitable[dict[str, Any]]]:
    """What a request for a session of this kind does: check it as a whole, conduct it, follow it."""

    async def conduct(call: Call) -> dict[str, Any]:
        attached, asked = _taken(call.arguments, kind.arguments)
        procedure = await asyncio.to_thread(kind.procedure, conductor.moving.installation, asked)
        running = conductor.start(procedure, attached=attached, uid=call.peer.uid)
        try:
            return await running.follow(call.progress)
        except (asyncio.CancelledError, ConnectionError):
            if attached:
                await _to_its_end(
                    conductor.cancel(running, f"the client it was attached to (process {call.peer.pid}) is gone")
                )
            raise

    return conduct


async def _to_its_end(work: Awaitable[None]) -> None:
    """Await safe ending even while this task itself is being cancelled."""
    task = asyncio.ensure_future(work)
    while not task.done():
        try:
            await asyncio.shield(task)
        except asyncio.CancelledError:
            continue
    task.result()


def _taken(arguments: dict[str, Any], model: type[Arguments]) -> tuple[bool, Arguments]:
    given = dict(arguments)
    attached = given.pop("attached", False)
    try:
        return bool(attached), model.model_validate(given)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise InputError("request", f"argument {where}: {first['msg']}") from None


async def _status(conductor: Conductor) -> dict[str, Any]:
    loop = conductor.moving.loop
    status = asdict(await asyncio.to_thread(loop.status))
    status["state"] = status["state"].name.lower()
    recorder = conductor.moving.recorder.report()
    running = conductor.current
    session = None
    if running is not None:
        session = {
            "id": running.session.id,
            "state": running.session.record.state,
            "stage": running.stage,
            "progress": running.share,
            "cause": running.session.record.cause,
        }
    return {
        "arm": conductor.moving.installation.arm.name,
        "joints": list(conductor.moving.installation.joint_names),
        "installation": str(conductor.moving.installation.path),
        **status,
        "recorder": {**asdict(recorder), "path": None if recorder.path is None else str(recorder.path)},
        "load": conductor.moving.load_now,
        "session": session,
    }
