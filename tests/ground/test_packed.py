"""Packed files: any Brotli reads them, files of before are read, and no flipped bit passes."""

from __future__ import annotations

import random

import brotli
import pytest

from ground.errors import DamagedFileError
from ground.gdr.packed import pack, unpack

CONTENTS = [b"", b"?", b'{"n":1,"k":"trace","t":12}\n' * 40, random.Random(4).randbytes(300)]


def bits_of(content: bytes) -> list[bytes]:
    """Return content with each of its bits flipped in turn."""
    return [
        content[:byte] + bytes([content[byte] ^ 1 << bit]) + content[byte + 1 :]
        for byte in range(len(content))
        for bit in range(8)
    ]


@pytest.mark.parametrize("content", CONTENTS, ids=len)
def test_any_brotli_reads_what_is_packed_and_what_was_packed_before_is_read(content: bytes) -> None:
    assert brotli.decompress(pack(content)) == unpack(pack(content)) == content
    assert unpack(brotli.compress(content, mode=brotli.MODE_TEXT, quality=5)) == content


def test_some_flipped_bits_would_not_change_what_comes_out() -> None:
    """Why the content's own hash is not enough."""

    def same(packed: bytes) -> bool:
        try:
            return bool(brotli.decompress(packed) == CONTENTS[2])
        except brotli.error:
            return False

    assert any(map(same, bits_of(brotli.compress(CONTENTS[2], mode=brotli.MODE_TEXT, quality=5))))


@pytest.mark.parametrize("content", CONTENTS, ids=len)
def test_every_flipped_bit_of_a_packed_file_is_found(content: bytes) -> None:
    for damaged in bits_of(pack(content)):
        with pytest.raises(DamagedFileError):
            unpack(damaged)
