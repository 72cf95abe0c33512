"""Messages pass in the order of their publisher, each once."""

import random
from collections.abc import Sequence

import numpy as np

from dropanchor_service.ingest.decode import Forms
from dropanchor_service.ingest.kernels.packed import FORM
from dropanchor_service.ingest.kernels.sequences import PER_TAG, WINDOW
from dropanchor_service.ingest.messages import Messages
from dropanchor_service.ingest.publishers import Publishers, Sequenced

S = 1_000_000_000
ROW, BOOT = 0, 7


def forms_of(numbers: Sequence[int], boot_id: int = BOOT) -> np.ndarray:
    forms = np.zeros(len(numbers), FORM)
    forms["accepted"] = forms["numbered"] = True
    forms["boot_id"] = boot_id
    forms["sequence"] = np.array(numbers, np.int64) % 2**32
    return forms


def put(publishers: Publishers, numbers: Sequence[int], boot_id: int = BOOT, due: bool = False) -> Sequenced:
    """Put messages of one tag that arrive at 1 s. due: none of them waits any longer."""
    n = len(numbers)
    messages = Messages(Forms(forms_of(numbers, boot_id)), np.full(n, ROW, np.int32), np.full(n, S), waited=n)
    return publishers.sequence(messages, S if due else S - 1)


def passed(publishers: Publishers, numbers: Sequence[int], due: bool = False) -> list[int]:
    """Put messages. Return the numbers of those that pass."""
    return [numbers[index] for index in put(publishers, numbers, due=due).due.tolist()]


def test_numbers_without_a_gap_pass_at_once() -> None:
    publishers = Publishers()
    for begin in range(0, 3000, 100):
        numbers = list(range(begin, begin + 100))
        assert passed(publishers, numbers) == numbers


def test_messages_behind_a_gap_wait_and_pass_in_order_once_it_is_filled() -> None:
    publishers = Publishers()
    assert passed(publishers, [0, 1, 3, 5]) == [0, 1]
    assert passed(publishers, [3, 5, 2]) == [2, 3]
    assert passed(publishers, [5, 4]) == [4, 5]


def test_messages_behind_a_gap_pass_when_they_are_due_and_the_missing_ones_are_counted() -> None:
    publishers = Publishers()
    assert passed(publishers, [0]) == [0]
    released = put(publishers, [6, 3], due=True)
    assert released.due.tolist() == [1, 0]
    assert released.missing == 4
    assert passed(publishers, [7]) == [7]


def test_a_due_message_releases_those_before_it_but_not_those_behind_the_next_gap() -> None:
    publishers = Publishers()
    assert passed(publishers, [0]) == [0]
    numbers, arrivals = [8, 5, 3], np.array([S + 9, S, S + 9])
    released = publishers.sequence(Messages(Forms(forms_of(numbers)), np.zeros(3, np.int32), arrivals, waited=3), S)
    assert [numbers[index] for index in released.due.tolist()] == [3, 5]
    assert [numbers[index] for index in released.pending.tolist()] == [8]


def test_a_message_that_was_given_up_passes_once_when_it_arrives() -> None:
    publishers = Publishers()
    assert passed(publishers, [0, 2], due=True) == [0, 2]
    again = put(publishers, [1, 1])
    assert again.due.tolist() == [0]
    assert again.duplicates.tolist() == [1]


def test_the_first_messages_of_a_running_publisher_wait_for_older_ones() -> None:
    publishers = Publishers()
    assert passed(publishers, [1001, 1000]) == []
    assert passed(publishers, [1001, 1000, 1002], due=True) == [1000, 1001, 1002]
    assert passed(publishers, [1003]) == [1003]


def test_shuffled_and_duplicated_numbers_pass_once_and_in_order() -> None:
    dice = random.Random(3)
    stream = [*range(2**32 - 400, 2**32), *range(600)]
    late = sorted([(position + dice.uniform(0, 40), number) for position, number in enumerate(stream * 2)])
    late = sorted((at if at < 1000 else at - 1000, number) for at, number in late)
    publishers, waiting, fused, doubles = Publishers(), list[int](), list[int](), 0
    assert put(publishers, [2**32 - 401], due=True).due.tolist() == [0]
    for begin in range(0, len(late), 7):
        numbers = [*waiting, *(number for _, number in late[begin : begin + 7])]
        result = put(publishers, numbers)
        fused += [numbers[index] for index in result.due.tolist()]
        waiting = [numbers[index] for index in result.pending.tolist()]
        doubles += len(result.duplicates)
    assert fused == stream
    assert doubles == len(stream)
    assert not waiting


def test_a_publisher_that_starts_counting_again_is_accepted() -> None:
    publishers = Publishers()
    assert passed(publishers, [WINDOW + 1], due=True) == [WINDOW + 1]
    assert passed(publishers, [0, 1, 1]) == [0, 1]


def test_no_message_waits_for_one_that_was_shed() -> None:
    publishers = Publishers()
    assert passed(publishers, [0]) == [0]
    publishers.allow_gap(np.array([ROW, 99]))
    released = put(publishers, [5, 6])
    assert released.due.tolist() == [0, 1]
    assert released.missing == 0
    assert passed(publishers, [9]) == []


def test_publishers_and_tags_do_not_wait_for_each_other() -> None:
    publishers = Publishers()
    assert put(publishers, [0, 2], boot_id=1).due.tolist() == [0]
    assert put(publishers, [0, 1], boot_id=2).due.tolist() == [0, 1]
    assert publishers.sequence(
        Messages(Forms(forms_of([0])), np.array([5], np.int32), np.array([S]), waited=1), 0
    ).due.tolist() == [0]


def test_new_boot_ids_replace_the_publisher_that_was_silent_for_longest() -> None:
    publishers = Publishers()
    for boot_id in range(2, 1000):
        for number, one in ((boot_id - 2, 1), (0, boot_id)):
            arrivals = np.array([S * boot_id + (one == 1)])
            messages = Messages(Forms(forms_of([number], one)), np.zeros(1, np.int32), arrivals, waited=1)
            released = publishers.sequence(messages, 0)
            assert released.due.tolist() == [0]
    assert len(publishers.columns) == PER_TAG


def test_a_copy_of_the_columns_continues_where_the_original_stopped() -> None:
    first, second = Publishers(), Publishers()
    assert passed(first, list(range(50))) == list(range(50))
    second.columns = first.columns
    known = first.sequence_states(ROW)[BOOT]
    assert [known.has(number) for number in (0, 49, 50, 2**32 - 1)] == [True, True, False, False]
    assert [known.ahead(number) for number in (2**32 - 1, 49, 50, 52)] == [-51, -1, 0, 2]
    assert first.sequence_states(ROW).keys() == {BOOT}
    assert first.sequence_states(ROW + 1) == {}
    again = put(second, [48, 49, 50, 52])
    assert again.duplicates.tolist() == [0, 1]
    assert again.due.tolist() == [2]
    assert passed(first, [50]) == [50]
