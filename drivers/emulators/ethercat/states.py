"""The state machine of an emulated slave's application layer, with its refusals (ETG.1000.6)."""

from __future__ import annotations

from collections.abc import Callable

from drivers.ethercat.registers import AL_ERROR, AL_STATE_MASK, AlCode, AlState, AlStatus

_NEXT = {AlState.INIT: AlState.PREOP, AlState.PREOP: AlState.SAFEOP, AlState.SAFEOP: AlState.OP}


class StateMachine:
    """States INIT, PREOP, SAFEOP and OP.

    Args:
        setup_error: returns, on the way to SAFEOP and OP, what is missing in the SyncManagers: None nothing, True
            outputs, False inputs.
    """

    def __init__(self, setup_error: Callable[[], bool | None]) -> None:
        self._setup_error = setup_error
        self.status = AlStatus(AlState.INIT)

    def request(self, control: int) -> None:
        """Handle a write to the control register. While there is an error, only a request that acknowledges it is
        accepted.
        """
        wanted, acknowledged = control & AL_STATE_MASK, bool(control & AL_ERROR)
        if self.status.error and not acknowledged:
            return
        present = AlState(self.status.state)
        if wanted == AlState.BOOT:
            self._refuse(AlCode.BOOT_NOT_SUPPORTED)
        elif wanted not in set(AlState):
            self._refuse(AlCode.UNKNOWN_STATE)
        elif wanted > present and wanted != _NEXT[present]:
            self._refuse(AlCode.INVALID_STATE_CHANGE)
        elif wanted >= AlState.SAFEOP and (missing := self._setup_error()) is not None:
            code = AlCode.INVALID_OUTPUTS if missing else AlCode.INVALID_INPUTS
            self.fall(min(present, AlState.PREOP), code)
        else:
            self.status = AlStatus(AlState(wanted))

    def fall(self, state: int, code: int) -> None:
        """Go to a state with an error."""
        self.status = AlStatus(state, True, code)

    def watchdog(self) -> None:
        """Fall to SAFEOP, because no process data arrived in time."""
        self.fall(AlState.SAFEOP, AlCode.WATCHDOG)

    def _refuse(self, code: AlCode) -> None:
        self.fall(AlState(self.status.state), code)


class CopiedStates(StateMachine):
    """States of a slave without a processor, in device emulation: the control word is copied into the status unchanged.

    So any request is granted, and an acknowledgement looks like an error from then on.
    """

    def __init__(self) -> None:
        super().__init__(lambda: None)

    def request(self, control: int) -> None:
        self.status = AlStatus(control & AL_STATE_MASK, bool(control & AL_ERROR))
