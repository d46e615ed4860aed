"""The routes of the page: files of the page itself, recordings, key frames, pictures, conversations, jobs."""

from __future__ import annotations

import hashlib
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from threading import Thread
from typing import Annotated, TypeVar

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, ValidationError
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Route

from appocc.errors import AppoccError, DataError, NotFoundError
from appocc.jsonparts import first_problem
from appocc.simulation.builtin import TEST_TOWNS, TRAIN_TOWNS
from appocc.simulation.scenario import WEATHER_SHARES
from cli.common import say
from cli.server.cache import BoundedCache
from cli.server.conversations import Conversations, talk_as_json, warm_up
from cli.server.guard import Guard
from cli.server.jobs import BusyError, Jobs
from cli.server.library import Library, describe
from cli.server.moments import Moments
from cli.server.pictures import WIDTHS_PX, camera_jpeg, map_sheet, read_picture
from cli.server.recording import Place, Recording
from cli.server.scene_tracks import TrackStore

_PAGE = Path(__file__).parent / "static"
_PICTURE_BYTES = 64 << 20
_MOST_SECONDS, _MOST_SEED = 60.0, 2**31 - 1
_Text = Annotated[str, StringConstraints(max_length=2000)]


class _Body(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)


_Form = TypeVar("_Form", bound=_Body)


class _TalkBody(_Body):
    """A turn of a conversation: one of `say` and `choose`, or neither to follow to another key frame."""

    talk: _Text | None = None
    recording: _Text
    scene: int = 0
    frame: int = 0
    source: _Text = ""
    say: _Text | None = None
    choose: _Text | None = None


class _DriveBody(_Body):
    """Settings of a simulated drive."""

    town: _Text
    weather: _Text
    seconds: Annotated[float, Field(ge=0.5, le=_MOST_SECONDS)]
    seed: Annotated[int, Field(ge=0, le=_MOST_SEED)] = 0
    weights: _Text | None = None


class _PredictBody(_Body):
    """The weights for new maps; None: the default ones."""

    weights: _Text | None = None


class Page:
    """The state of the server, and the functions behind its routes."""

    def __init__(self, library: Library) -> None:
        """Serve the recordings of a library."""
        self._library = library
        self._tracks = TrackStore()
        self._moments = Moments(self._tracks)
        self._conversations = Conversations(self._moments)
        self.jobs = Jobs()
        self._pictures: BoundedCache[str, bytes] = BoundedCache(_PICTURE_BYTES, len)

    def close(self) -> None:
        """End the work that goes on in the background."""
        self.jobs.close()
        self._tracks.close()

    # Recordings -----------------------------------------------------------------------------------------------------

    def recordings(self, request: Request) -> Response:
        """List the recordings, and what a drive can be simulated with."""
        self._library.refresh()
        drives = None
        if self._library.new_drives is not None:
            towns = [*TEST_TOWNS, *TRAIN_TOWNS]
            drives = {"towns": towns, "weathers": list(WEATHER_SHARES), "most_seconds": _MOST_SECONDS}
        return JSONResponse(
            {
                "recordings": [describe(one) for one in self._library.recordings()],
                "drives": drives,
                "weights": list(self._library.weights()),
                "trainings": list(self._library.trainings()),
            }
        )

    def moment(self, request: Request) -> Response:
        """Return a key frame as JSON."""
        recording, place = self._place(request)
        return JSONResponse(self._moments.as_json(recording, place))

    def path(self, request: Request) -> Response:
        """Return the path of a vehicle."""
        recording, place = self._place(request)
        return JSONResponse(self._moments.path(recording, place, request.query_params.get("id", "")))

    def map(self, request: Request) -> Response:
        """Return the map of a key frame as a sheet of values (PNG)."""
        recording, place = self._place(request)
        path = recording.map_path(place)
        return self._picture(request, path, "png", lambda: map_sheet(recording.bev(place)), "no-cache")

    def camera(self, request: Request) -> Response:
        """Return a camera image (JPEG) at one of the widths of the page."""
        recording, place = self._place(request)
        width = _number(request.query_params.get("width", str(WIDTHS_PX[0])))
        if width not in WIDTHS_PX:
            raise DataError(f"expected a width of {', '.join(map(str, WIDTHS_PX))}, got {width}")
        path = recording.image_path(place.scene, place.frame, request.path_params["channel"])
        made = f"jpeg {width}"
        return self._picture(request, path, made, lambda: camera_jpeg(path, width), "private, max-age=60")

    def curves(self, request: Request) -> Response:
        """Return the curves of a training (PNG) as it has drawn them last."""
        path = self._library.trainings().get(request.query_params.get("name", ""))
        if path is None or not path.is_file():
            raise NotFoundError("this training has drawn no curves yet")
        return self._picture(request, path, "png", lambda: read_picture(path), "no-cache")

    def _picture(self, request: Request, path: Path, made: str, make: Callable[[], bytes], keep: str) -> Response:
        """Return a picture made of a file, or that the browser's own is still good."""
        try:
            state = path.stat()
        except OSError as error:
            raise NotFoundError(f"{path.name}: there is no such file") from error
        key = hashlib.sha256(f"{path}\0{state.st_mtime_ns}\0{state.st_size}\0{made}".encode()).hexdigest()[:32]
        headers = {"etag": f'"{key}"', "cache-control": keep}
        if request.headers.get("if-none-match") == headers["etag"]:
            return Response(status_code=304, headers=headers)
        kind = "image/png" if made == "png" else "image/jpeg"
        return Response(self._pictures.get(key, make), headers=headers, media_type=kind)

    def _place(self, request: Request) -> tuple[Recording, Place]:
        """Return the recording and the place that an address names."""
        names = request.path_params
        recording = self._library.recording(names["recording"])
        place = Place(_number(names["scene"]), _number(names["frame"]), request.query_params.get("source", ""))
        recording.sample(place.scene, place.frame)
        return recording, place

    # Conversations --------------------------------------------------------------------------------------------------

    def talk(self, request: Request) -> Response:
        """Say a sentence, choose a vehicle, or follow to another key frame."""
        body = _checked(_TalkBody, request)
        recording = self._library.recording(body.recording)
        place = Place(body.scene, body.frame, body.source)
        recording.sample(place.scene, place.frame)
        talk = self._conversations.talk(body.talk)
        if body.say is not None:
            return JSONResponse(self._conversations.say(talk, recording, place, body.say))
        if body.choose is not None:
            return JSONResponse(self._conversations.choose(talk, recording, place, body.choose))
        return JSONResponse(self._conversations.move(talk, recording, place))

    def talked(self, request: Request) -> Response:
        """Return a conversation as it stands."""
        talk = self._conversations.talk(request.path_params["talk"])
        return JSONResponse(talk_as_json(talk))

    # Jobs -----------------------------------------------------------------------------------------------------------

    def listed_jobs(self, request: Request) -> Response:
        """List the jobs with their progress, and the recording that each made."""
        jobs = self.jobs.listed()
        if any(job.state == "done" and self._key(job.root) is None for job in jobs):
            self._library.refresh()
        return JSONResponse({"jobs": [{**job.as_json(), "recording": self._key(job.root)} for job in jobs]})

    def _key(self, root: Path) -> str | None:
        return next((one.key for one in self._library.recordings() if one.root == root), None)

    def simulate(self, request: Request) -> Response:
        """Start a simulated drive."""
        body = _checked(_DriveBody, request)
        folder = self._library.new_drives
        if folder is None:
            raise DataError("open a folder for new drives: appocc serve FOLDER")
        if body.town not in (*TEST_TOWNS, *TRAIN_TOWNS) or body.weather not in WEATHER_SHARES:
            raise NotFoundError("expected one of the towns and weathers of the list")
        title = f"{body.town}, {body.weather.replace('_', ' ')}, {body.seconds:g} s"
        root = folder / f"{body.town}-{body.weather}-{body.seconds:g}s-{body.seed}"
        settings = body.model_dump() | self._weights(body.weights)
        return JSONResponse(self.jobs.start("simulate", title, root, settings).as_json(), 201)

    def predict(self, request: Request) -> Response:
        """Start the prediction of the maps of a recording."""
        recording = self._library.recording(request.path_params["recording"])
        body = _checked(_PredictBody, request)
        title = f"maps of {recording.title}{f', weights {body.weights}' if body.weights else ''}"
        settings = {"version": recording.version, **self._weights(body.weights)}
        return JSONResponse(self.jobs.start("predict", title, recording.root, settings).as_json(), 201)

    def _weights(self, name: str | None) -> dict[str, str]:
        """Return the weights of a job, and the source of its maps.

        Raises:
            NotFoundError: if no weights of the list have this name.
        """
        known = self._library.weights()
        if name is not None and name not in known:
            raise NotFoundError("expected weights of the list; were they removed?")
        if not known:
            raise NotFoundError("there are no weights: none come with this version of appocc")
        chosen = known[name] if name is not None else next(iter(known.values()))
        return {"weights": str(chosen.path), "source": chosen.source}

    def stop(self, request: Request) -> Response:
        """Stop a job."""
        return JSONResponse(self.jobs.stop(_number(request.path_params["job"])).as_json())


def _number(text: str) -> int:
    """Return a whole number of an address.

    Raises:
        NotFoundError: if it is none.
    """
    if not (text.isascii() and text.isdigit() and len(text) <= 9):
        raise NotFoundError("expected a number in this address")
    return int(text)


def _checked(form: type[_Form], request: Request) -> _Form:
    """Return the body of a request in its form.

    Raises:
        DataError: if it does not fit.
    """
    try:
        return form.model_validate(request.state.body)
    except ValidationError as error:
        raise DataError(first_problem(error, form)) from error


async def _page_file(request: Request) -> Response:
    """Return a file of the page."""
    name = request.path_params.get("name", "index.html")
    files = {path.name: path for path in _PAGE.iterdir()}
    if name not in files:
        raise HTTPException(404)
    return FileResponse(files[name], headers={"cache-control": "no-cache"})


def _on_error(request: Request, error: Exception) -> Response:
    status = 404 if isinstance(error, NotFoundError) else 409 if isinstance(error, BusyError) else 400
    return JSONResponse({"error": str(error)}, status)


def _on_http_error(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    return JSONResponse({"error": "there is nothing at this address"}, error.status_code)


def _on_fault(request: Request, error: Exception) -> Response:
    say(f"error: {request.url.path}: {type(error).__name__}: {error}")
    return JSONResponse({"error": "something went wrong here; the terminal of appocc serve shows what"}, 500)


def build_app(library: Library, token: str | None = None) -> Starlette:
    """Return the application of the page.

    Args:
        library: recordings to show.
        token: required of every request; None: only requests to this machine's own names are answered.
    """
    page = Page(library)

    @asynccontextmanager
    async def lifespan(app: Starlette) -> AsyncIterator[None]:
        warming = Thread(target=warm_up, daemon=True, name="warm up")
        warming.start()
        yield
        page.close()
        warming.join()

    at_frame = "/api/recordings/{recording}/{scene}/{frame}"
    routes = [
        Route("/", _page_file),
        Route("/static/{name}", _page_file),
        Route("/api/recordings", page.recordings),
        Route("/api/recordings/{recording}/predict", page.predict, methods=["POST"]),
        Route(at_frame, page.moment),
        Route(f"{at_frame}/path", page.path),
        Route(f"{at_frame}/map.png", page.map),
        Route(f"{at_frame}/cameras/{{channel}}", page.camera),
        Route("/api/curves", page.curves),
        Route("/api/talk", page.talk, methods=["POST"]),
        Route("/api/talk/{talk}", page.talked),
        Route("/api/jobs", page.listed_jobs),
        Route("/api/jobs/{job}/stop", page.stop, methods=["POST"]),
        Route("/api/drives", page.simulate, methods=["POST"]),
    ]
    app = Starlette(
        routes=routes,
        lifespan=lifespan,
        exception_handlers={AppoccError: _on_error, HTTPException: _on_http_error, Exception: _on_fault},
    )
    app.add_middleware(Guard, token=token)
    return app
