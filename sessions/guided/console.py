"""The operator's console: reads requests, stores notes, watches the sensors, and shows the state."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from drivers.core.clock import NANOSECONDS
from drivers.core.errors import TactileLabError
from sessions.conductor.decisions import GraspAbandonedError
from sessions.conductor.guided_settings import GuidedSettings
from sessions.guided.operator import Ask, Operator, Panel, Request, Stage
from sessions.guided.operator_view import OperatorView, Watcher
from sessions.motion.safety import InterruptGuard
from sessions.recording.attachments import Attachments
from sessions.recording.recorder import Level
from sessions.rig_runtime.rig_runtime import RigRuntime

BEFORE_CAPTURE = frozenset({Stage.GUIDE, Stage.CLOSE, Stage.HOLD, Stage.CAPTURE})


class OperatorConsole:
    """Connects the operator and the session.

    Args:
        runtime: connected.
        operator: the person.
        settings: of the guided session.
        attachments: stores notes, pictures and files.
        touch_force_N: force above which a finger touches.
        guard: receives Ctrl+C, which ends the session even while waiting for the operator.
        pace: called with the session clock after every cycle; makes a simulated rig wait for the person.
    """

    def __init__(
        self,
        runtime: RigRuntime,
        operator: Operator,
        settings: GuidedSettings,
        attachments: Attachments,
        touch_force_N: float,
        guard: InterruptGuard,
        pace: Callable[[int], None] = lambda stamp_ns: None,
    ) -> None:
        self._runtime, self._operator, self.settings = runtime, operator, settings
        self._attachments, self._guard, self._pace = attachments, guard, pace
        self._watcher = Watcher(runtime.perception, settings, touch_force_N)
        self.view = OperatorView({})
        self.automatic = settings.automatic
        self.grasp = 1
        self.suggestion, self.unknown = "", "the whole object is unknown"
        self.paused = ""
        """Why the session is paused; "" if it is not."""
        self.end_wanted = self.undo_wanted = False
        self._given_up = ""
        self._end_asked = False
        self._stage, self._prompt = Stage.PLACE, ""
        self._asks: tuple[Ask, ...] = ()
        self._message = ""
        self._waiting: deque[Request] = deque()
        self._warned_of_nothing = False
        self._next_panel_ns = 0
        self._heard_ns: int | None = None
        self._markers = self._photos = 0
        self._known_silent: frozenset[str] = frozenset()
        self._common: dict[Ask, Callable[[Request], None]] = {
            Ask.PAUSE: self._toggle_pause,
            Ask.END: self._ask_end,
            Ask.AUTOMATIC: self._toggle_automatic,
            Ask.NOTE: self._note,
            Ask.MARKER: self._mark_instant,
            Ask.PHOTO: self._photo,
            Ask.ATTACH: self._attach,
        }

    # --- for whoever leads through a grasp ---------------------------------------------------------------------

    def enter(self, stage: Stage, prompt: str, *asks: Ask) -> None:
        """Start a new step; earlier requests are discarded."""
        self._stage, self._prompt, self._asks = stage, prompt, asks
        self._warned_of_nothing = False
        self._waiting.clear()
        self._given_up = self._given_up if stage in BEFORE_CAPTURE else ""
        self._show(self._runtime.clock.now_ns())

    def take(self) -> list[Request]:
        """Requests in this step since the last call."""
        requests = list(self._waiting)
        self._waiting.clear()
        return requests

    def wants_capture(self) -> bool:
        """Whether the operator requests the capture, or it is automatic and the grasp is steady.

        Without any finger in contact the operator has to ask twice: the grasp would count, without any information.
        """
        asked = any(request.ask in (Ask.NEXT, Ask.CAPTURE) for request in self.take())
        if asked and not self.view.touching and not self._warned_of_nothing:
            self._warned_of_nothing = True
            self.tell("no finger is in contact. Ask again to capture all the same", Level.WARNING)
            return False
        return asked or (self.automatic and self.view.is_steady)

    @property
    def is_attended(self) -> bool:
        """Whether a person is there, who can do something about a failure."""
        return self._operator.attended

    @property
    def moves_on(self) -> bool:
        """Whether the operator wants to leave this step."""
        return self.end_wanted or self.undo_wanted

    def tell(self, message: str, level: Level = Level.INFO) -> None:
        """Show a message to the operator, and record it."""
        self._message = message
        self._runtime.log(level, "guide", message)

    @property
    def holds(self) -> bool:
        """Whether the session is paused within a grasp: the hand stays as it is."""
        return bool(self.paused) and self._stage not in (Stage.PLACE, Stage.ESTIMATE)

    def check_given_up(self) -> None:
        """Raises GraspAbandonedError if the operator has given up the current grasp."""
        if self._given_up and self._stage in BEFORE_CAPTURE:
            reason, self._given_up = self._given_up, ""
            self._stage = Stage.RELEASE
            raise GraspAbandonedError(reason)

    # --- every cycle -------------------------------------------------------------------------------------------

    def cycle(self) -> None:
        """Read sensors and requests, and update the display."""
        now_ns = self._runtime.clock.now_ns()
        self._watcher.take(now_ns)
        for request in self._operator.requests():
            self._heard_ns = now_ns
            self._sort(request)
        if self._guard.requested:
            self._leave("interrupted by the operator")
        self._heard_ns = now_ns if self._heard_ns is None else self._heard_ns
        if now_ns - self._heard_ns > self.settings.attention_s * NANOSECONDS:
            self._leave(f"no input from the operator for {self.settings.attention_s:g} s")
        if now_ns >= self._next_panel_ns:
            self._show(now_ns)
        self._pace(now_ns)

    def rest(self) -> None:
        """One cycle of a pause; errors are shown."""
        try:
            self._runtime.cycle()
        except TactileLabError as error:
            self._message = str(error)
            self._runtime.clock.sleep_until_ns(self._runtime.clock.now_ns() + self._runtime.cycle_ns)
        self.cycle()

    def fail(self, reason: str) -> bool:
        """Everything has stopped. Returns whether an operator is present to fix the problem and resume."""
        self._waiting.clear()
        self._stage, self._asks = Stage.PLACE, ()
        self.paused = reason
        return self.is_attended

    def _show(self, now_ns: int) -> None:
        self._next_panel_ns = now_ns + round(self.settings.panel_s * NANOSECONDS)
        self.view = self._watcher.view(now_ns)
        self._watch_sensors()
        panel = self.panel(now_ns)
        self._operator.show(panel)
        self._runtime.recorder.guide(now_ns, panel.content())

    def panel(self, now_ns: int) -> Panel:
        """The current panel."""
        return Panel(
            stamp_ns=now_ns,
            grasp=self.grasp,
            stage=self._stage,
            prompt="Paused. p: resume, e: end session" if self.paused else self._prompt,
            view=self.view,
            capture=self._until_capture() if self._stage is Stage.HOLD else "",
            suggestion=self.suggestion,
            unknown=self.unknown,
            message=self._message,
            paused=self.paused,
            automatic=self.automatic,
            asks=self._asks,
        )

    def _until_capture(self) -> str:
        missing = self.settings.least_contacts - len(self.view.touching)
        if missing > 0:
            return "1 more finger must touch" if missing == 1 else f"{missing} more fingers must touch"
        if not self.view.is_steady:
            return f"hold still: steady for {self.view.steady_s:.1f} of {self.settings.steady_s:g} s"
        return "steady"

    def _watch_sensors(self) -> None:
        """Report a sensor that falls silent, and pause the session if an operator is present."""
        silent = frozenset(self.view.silent)
        fallen, back = silent - self._known_silent, self._known_silent - silent
        self._known_silent = silent
        if fallen:
            self.tell(f"no usable reading from {', '.join(sorted(fallen))}: check cable and power", Level.WARNING)
            if self.is_attended:
                self._pause(self._message)
        if back:
            self.tell(f"readings from {', '.join(sorted(back))} are back")

    # --- what can always be asked for --------------------------------------------------------------------------

    def _sort(self, request: Request) -> None:
        self._end_asked = self._end_asked and request.ask is Ask.END
        if act := self._common.get(request.ask):
            act(request)
        elif self.paused:
            self._message = "paused. p: resume"
        elif request.ask is Ask.GIVE_UP or (request.ask is Ask.UNDO and self._stage in BEFORE_CAPTURE):
            self._give_up("given up by the operator")
        elif request.ask is Ask.UNDO and self._stage is not Stage.PLACE:
            self.undo_wanted = True
            self.tell("this grasp will be undone")
        else:
            self._waiting.append(request)

    def _give_up(self, reason: str) -> None:
        if self._stage in BEFORE_CAPTURE:
            self._given_up = reason
        else:
            self._message = "there is no closing to give up. u: undo the last grasp"

    def _toggle_pause(self, request: Request) -> None:
        if self.paused:
            self._go_on()
        else:
            self._pause(request.text or "by the operator")

    def _pause(self, reason: str) -> None:
        self.paused = reason
        self.tell(f"paused: {reason}")
        self._next_panel_ns = 0

    def _go_on(self) -> None:
        """Restart silent sensors; if one cannot be restarted the session stays paused."""
        for finger in self._known_silent:
            try:
                self._runtime.restart_fingertip(finger)
            except TactileLabError as error:
                self.tell(f"still paused: {error}", Level.WARNING)
                return
        self.paused = ""
        self.tell("resumed")
        self._next_panel_ns = 0

    def _ask_end(self, request: Request) -> None:
        if self._end_asked or request.text:
            self._leave("ended by the operator")
        else:
            self._end_asked, self._message = True, "press again to end the session"

    def _leave(self, reason: str) -> None:
        if not self.end_wanted:
            self.end_wanted, self._given_up, self.paused = True, reason, ""
            self.tell(reason)

    def _toggle_automatic(self, request: Request) -> None:
        self.automatic = not self.automatic
        self.tell(f"automatic capture {'on' if self.automatic else 'off'}")

    def _note(self, request: Request) -> None:
        self._attachments.note(request.text)
        self.tell(f"note: {request.text}")

    def _mark_instant(self, request: Request) -> None:
        self._markers += 1
        self.tell(f"marker {self._markers} {request.text}".rstrip())

    def _photo(self, request: Request) -> None:
        if self._runtime.camera is None:
            self._message = "this rig has no camera"
            return
        self._photos += 1
        try:
            name = self._attachments.picture(f"photo-{self._photos:03d}", self._runtime.picture().picture)
        except TactileLabError as error:
            self.tell(str(error), Level.WARNING)
        else:
            self.tell(f"photo kept as {name} {request.text}".rstrip())

    def _attach(self, request: Request) -> None:
        try:
            self.tell(f"attached {self._attachments.file(request.text)}")
        except TactileLabError as error:
            self.tell(str(error), Level.WARNING)
