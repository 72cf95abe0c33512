"""Duplicates by number, and clocks that count from the start of the tag."""

import random

from dropanchor_service.clock import PUBLISHERS_PER_TAG, WINDOW, Publisher, Publishers

S = 1_000_000_000


def test_each_number_is_new_once_in_any_order_inside_the_window() -> None:
    numbers = list(range(500)) * 2
    random.Random(3).shuffle(numbers)
    publisher = Publisher()
    assert sum(publisher.is_new(number) for number in numbers) == 500


def test_the_number_wraps_around_without_a_duplicate() -> None:
    publisher = Publisher()
    numbers = [(2**32 - 5 + i) % 2**32 for i in range(10)]
    assert all(publisher.is_new(number) for number in numbers)
    assert not any(publisher.is_new(number) for number in numbers)


def test_a_publisher_that_counts_from_the_start_again_is_heard() -> None:
    publisher = Publisher()
    assert publisher.is_new(WINDOW + 1)
    assert publisher.is_new(0)
    assert publisher.is_new(1)
    assert not publisher.is_new(1)


def test_made_up_boot_ids_do_not_fill_the_memory_and_push_out_the_oldest() -> None:
    publishers = Publishers()
    live = publishers.of(0, boot_id=1)
    for boot_id in range(2, 1000):
        publishers.of(0, boot_id)
        assert publishers.of(0, 1) is live
    assert publishers.of(0, 5) is not None
    assert len(publishers._by_row[0]) == PUBLISHERS_PER_TAG


def test_a_boot_clock_is_mapped_by_the_message_with_the_least_delay() -> None:
    publisher, boot_ns = Publisher(), 1_760_000_000 * S
    dice = random.Random(5)
    for i in range(300):
        delay_ns = dice.choice((5_000_000, 80_000_000, 400_000_000))
        offset_ns = publisher.utc_offset_ns(i * S // 10, boot_ns + i * S // 10 + delay_ns)
    assert offset_ns == boot_ns + 5_000_000


def test_the_mapping_follows_a_drifting_crystal() -> None:
    publisher = Publisher()
    for second in range(3600):
        utc_ns = 1_760_000_000 * S + second * S
        tag_ns = second * S - second * 50_000  # 50 ppm slow
        offset_ns = publisher.utc_offset_ns(tag_ns, utc_ns)
    assert abs(tag_ns + offset_ns - utc_ns) <= 61 * 50_000
