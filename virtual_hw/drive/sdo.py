"""The SDO server: expedited and segmented transfers (CiA 301, 7.2.4); block transfer is refused."""

from __future__ import annotations

import struct

from virtual_hw.drive.aborts import Abort, SdoAbort
from virtual_hw.drive.objects import ObjectStore

_ABORT = struct.Struct("<BHBI")
_SEGMENT = 7


class _Transfer:
    """A segmented transfer under way."""

    def __init__(self, index: int, subindex: int, *, download: bool, data: bytes = b"", announced: int | None = None):
        self.index, self.subindex = index, subindex
        self.download = download
        self.data = bytearray(data)
        self.announced = announced
        self.toggle = 0


class SdoServer:
    """Answers one client; a new initiate request takes the place of a transfer that was left unfinished."""

    def __init__(self, store: ObjectStore) -> None:
        self._store = store
        self._transfer: _Transfer | None = None

    def reset(self) -> None:
        self._transfer = None

    def answer(self, request: bytes) -> bytes | None:
        """The eight bytes that answer eight bytes; None where the protocol has no answer (an abort)."""
        if len(request) != 8:
            return None
        command = request[0] >> 5
        index, subindex = int.from_bytes(request[1:3], "little"), request[3]
        if command in (0, 3) and self._transfer is not None:
            index, subindex = self._transfer.index, self._transfer.subindex
        try:
            if command == 1:
                return self._initiate_download(request, index, subindex)
            if command == 0:
                return self._download_segment(request)
            if command == 2:
                return self._initiate_upload(index, subindex)
            if command == 3:
                return self._upload_segment(request)
            if command == 4:
                self._transfer = None
                return None
            raise SdoAbort(Abort.COMMAND)
        except SdoAbort as refusal:
            self._transfer = None
            return _ABORT.pack(0x80, index, subindex, refusal.code)

    def _initiate_download(self, request: bytes, index: int, subindex: int) -> bytes:
        self._transfer = None
        expedited, sized = request[0] & 2, request[0] & 1
        if expedited:
            size = 4 - (request[0] >> 2 & 3) if sized else min(4, self._store.entry(index, subindex).size)
            self._store.write(index, subindex, request[4 : 4 + size])
        else:
            entry = self._store.entry(index, subindex)
            announced = int.from_bytes(request[4:8], "little") if sized else None
            if not entry.writable:
                raise SdoAbort(Abort.READ_ONLY)
            if announced is not None and announced != entry.size:
                raise SdoAbort(Abort.TOO_LONG if announced > entry.size else Abort.TOO_SHORT)
            self._transfer = _Transfer(index, subindex, download=True, announced=announced)
        return b"\x60" + request[1:4] + bytes(4)

    def _download_segment(self, request: bytes) -> bytes:
        transfer = self._expect(download=True)
        toggle = request[0] >> 4 & 1
        if toggle != transfer.toggle:
            raise SdoAbort(Abort.TOGGLE)
        transfer.data += request[1 : 1 + _SEGMENT - (request[0] >> 1 & 7)]
        transfer.toggle ^= 1
        limit = transfer.announced if transfer.announced is not None else 8
        if len(transfer.data) > limit:
            raise SdoAbort(Abort.TOO_LONG)
        if request[0] & 1:
            self._transfer = None
            if transfer.announced is not None and len(transfer.data) != transfer.announced:
                raise SdoAbort(Abort.LENGTH)
            self._store.write(transfer.index, transfer.subindex, bytes(transfer.data))
        return bytes((0x20 | toggle << 4,)) + bytes(7)

    def _initiate_upload(self, index: int, subindex: int) -> bytes:
        self._transfer = None
        data = self._store.read(index, subindex)
        head = struct.pack("<HB", index, subindex)
        if 0 < len(data) <= 4:
            return bytes((0x43 | (4 - len(data)) << 2,)) + head + data.ljust(4, b"\0")
        self._transfer = _Transfer(index, subindex, download=False, data=data)
        return b"\x41" + head + struct.pack("<I", len(data))

    def _upload_segment(self, request: bytes) -> bytes:
        transfer = self._expect(download=False)
        toggle = request[0] >> 4 & 1
        if toggle != transfer.toggle:
            raise SdoAbort(Abort.TOGGLE)
        transfer.toggle ^= 1
        piece = bytes(transfer.data[:_SEGMENT])
        del transfer.data[:_SEGMENT]
        last = not transfer.data
        if last:
            self._transfer = None
        return bytes((toggle << 4 | (_SEGMENT - len(piece)) << 1 | last,)) + piece.ljust(_SEGMENT, b"\0")

    def _expect(self, *, download: bool) -> _Transfer:
        if self._transfer is None or self._transfer.download is not download:
            raise SdoAbort(Abort.COMMAND)
        return self._transfer
