"""The store under damage: every byte, every page, swapped and lost pages, torn writes, disks that fill at any byte."""

import errno
import io
import warnings
from contextlib import closing

import numpy as np
import pytest

from studies.errors import InputError, MissingEnvironment
from studies.sweeps.block import Batch, Cases, Remark
from studies.sweeps.opening import claim_store, open_store
from studies.sweeps.store import FILE, Store

IDENTITY = {"base": "b", "design": "d"}
PAGE = 4096


def cases_of(first, count):
    """Designs (x, x²) with the results x³ and x⁴, of which every seventh failed."""
    places = np.arange(first, first + count)
    x = np.sqrt(places + 0.5)
    values = np.stack([x**3, x**4], axis=1)
    lost = [row for row in range(count) if places[row] % 7 == 3]
    values[lost] = np.nan
    remarks = (Remark("failed", "it is the third of seven", lost),) if lost else ()
    return Cases(Batch(places, np.stack([x, x**2], axis=1)), values, 1e-6 * values, 0.25, remarks)


def fill(store, total, size):
    """Add what the store lacks, as a run does, and return how many cases these are."""
    done = np.zeros(total, dtype=bool)
    done[: min(len(store.done), total)] = store.done[:total]
    added = 0
    for first in range(0, total, size):
        lacking = first + np.flatnonzero(~done[first : first + size])
        if lacking.size:
            whole = cases_of(first, size)
            rows = lacking - first
            failed = [list(rows).index(row) for row in whole.remarks[0].rows if row in rows] if whole.remarks else []
            remarks = (whole.remarks[0]._replace(rows=failed),) if failed else ()
            store.add(
                Cases(Batch(lacking, whole.batch.designs[rows]), whole.values[rows], whole.errors[rows], 0.1, remarks)
            )
            added += len(lacking)
    return added


def begin(store):
    store.check_same(IDENTITY)
    store.describe({"identity": IDENTITY, "cases": 1})
    store.begin_run({"packages": {}})


def content_of(store):
    found = [columns for _, columns in store.read(range(0, 7))]
    return np.concatenate(found, axis=1).tobytes(), dict(store.remarks)


def make(folder, total, size):
    with closing(claim_store(folder)) as store:
        begin(store)
        assert fill(store, total, size) == total
        store.end_run("finished")
        return (folder / FILE).read_bytes(), content_of(store)


def check_damage(folder, damaged, total, size, whole):
    """A reader refuses or has less, never other cases; one run mends it for good, computing only what is lacking."""
    (folder / FILE).write_bytes(damaged)
    try:
        with closing(open_store(folder)) as store:
            assert store.done.sum() < total or content_of(store) == whole
    except InputError as error:
        refused = str(error)
    else:
        refused = ""
    with warnings.catch_warnings(record=True, action="always") as said, closing(claim_store(folder)) as store:
        lacking = total - int(store.done.sum())
        begin(store)
        fill(store, total, size)
    assert ["computed again" in str(one.message) for one in said] == ["damaged" in refused] * bool(refused)
    with closing(open_store(folder)) as store:
        assert content_of(store) == whole
        assert store.counts() == {"ok": total - len(whole[1]), "failed": len(whole[1])}
    return lacking


def test_a_flipped_bit_in_any_byte_is_found(tmp_path):
    """In the last block's head alone it looks like a write that was torn: its cases lack then, and nothing else."""
    file, whole = make(tmp_path, 24, 8)
    assert len(file) < 4000
    for place in range(len(file)):
        damaged = bytearray(file)
        damaged[place] ^= 1 << place % 8
        store = Store(io.BytesIO(damaged), tmp_path / FILE)
        assert store.file.damaged or store.file.end < len(file)
        assert int(store.done.sum()) in (16, 24)
        if store.done.sum() == 24:
            assert content_of(store) == whole


@pytest.mark.slow
def test_a_page_flipped_swapped_or_lost_is_found_and_mended(tmp_path):
    file, whole = make(tmp_path, 6000, 500)
    pages = [file[k : k + PAGE] for k in range(0, len(file), PAGE)]
    assert len(pages) > 30
    rng = np.random.default_rng(3)
    for k in range(0, len(pages), 3):
        flipped = bytearray(file)
        flipped[int(rng.integers(k * PAGE, min((k + 1) * PAGE, len(file))))] ^= 1 << int(rng.integers(8))
        other = (k + 1 + int(rng.integers(len(pages) - 1))) % len(pages)
        swapped = list(pages)
        swapped[k], swapped[other] = pages[other], pages[k]
        empty = [*pages[:k], bytes(len(pages[k])), *pages[k + 1 :]]
        for damaged in (flipped, b"".join(swapped), b"".join(empty), b"".join([*pages[:k], *pages[k + 1 :]])):
            assert check_damage(tmp_path, damaged, 6000, 500, whole) <= 2500


@pytest.mark.slow
def test_a_write_that_was_torn_at_any_byte_is_no_damage(tmp_path):
    file, whole = make(tmp_path, 24, 8)
    for end in range(0, len(file), 5):
        (tmp_path / FILE).write_bytes(file[:end])
        with closing(open_store(tmp_path)) as store:
            assert not store.file.damaged
        with closing(claim_store(tmp_path)) as store:
            begin(store)
            fill(store, 24, 8)
        with closing(open_store(tmp_path)) as store:
            assert content_of(store) == whole


class Filling(io.BytesIO):
    """A disk with room for so many bytes."""

    room = 0

    def write(self, content):
        if self.tell() >= self.room:
            raise OSError(errno.ENOSPC, "No space left on device")
        return super().write(memoryview(content)[: self.room - self.tell()])


@pytest.mark.slow
def test_a_disk_that_fills_at_any_byte_keeps_what_was_whole(tmp_path):
    file, whole = make(tmp_path, 24, 8)
    for room in range(0, len(file), 7):
        disk = Filling()
        disk.room = room
        store = Store(disk, tmp_path / FILE)
        with pytest.raises(MissingEnvironment, match=r"No space left.*run the same command again"):  # noqa: PT012
            begin(store)
            fill(store, 24, 8)
            store.end_run("finished")
        disk.room = 10**6
        again = Store(io.BytesIO(disk.getvalue()), tmp_path / FILE)
        assert not again.file.damaged
        begin(again)
        fill(again, 24, 8)
        assert content_of(again) == whole


def test_what_a_study_is_may_be_damaged_but_no_other_study_follows(tmp_path):
    file, _ = make(tmp_path, 24, 8)
    place = file.index(b'"identity"')
    (tmp_path / FILE).write_bytes(file[:place] + b"X" + file[place + 1 :])
    with pytest.warns(UserWarning, match="damaged"):
        claimed = claim_store(tmp_path)
    with closing(claimed) as store:
        with pytest.raises(InputError, match="a study that differs"):
            store.check_same({"base": "b", "design": "another"})
        begin(store)
        assert fill(store, 24, 8) == 0


def test_of_a_case_computed_twice_the_later_counts(tmp_path):
    with closing(claim_store(tmp_path)) as store:
        begin(store)
        fill(store, 24, 8)
        store.forget("failed")
        assert store.counts() == {"ok": 21}
        values = np.array([[1.0, 2.0]])
        store.add(Cases(Batch(np.array([10]), np.array([[3.0, 9.0]])), values, values, 0.1))
    with closing(open_store(tmp_path)) as store:
        assert store.counts() == {"ok": 22, "failed": 2}
        places, columns = (np.concatenate(parts, axis=-1) for parts in zip(*store.read([3, 4]), strict=True))
        assert places.tolist() == list(range(24))
        assert columns[:, 10].tolist() == [1.0, 2.0]


def test_a_store_that_may_only_be_read_is_read_whatever_a_kill_has_left(tmp_path):
    file, _ = make(tmp_path, 24, 8)
    (tmp_path / FILE).write_bytes(file[:-100])
    (tmp_path / FILE).chmod(0o444)
    tmp_path.chmod(0o555)
    try:
        with closing(open_store(tmp_path)) as store:
            assert store.done[:24].all()
    finally:
        tmp_path.chmod(0o755)
