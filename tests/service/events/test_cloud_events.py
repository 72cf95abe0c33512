"""Events are CloudEvents 1.0: the SDK of the CloudEvents project reads them."""

from cloudevents.core.bindings.http import HTTPMessage, from_http_event

from support.events import EventBench, circle


def test_the_sdk_of_cloudevents_reads_an_event() -> None:
    bench = EventBench()
    bench.put(circle())
    bench.stay(2.0, "cart/1", x=0.0)
    body = bench.store.after(0, 1)[0].body
    event = from_http_event(HTTPMessage({"content-type": "application/cloudevents+json"}, body))
    assert (event.get_specversion(), event.get_type()) == ("1.0", "dropanchor.zone.enter")
    assert (event.get_subject(), event.get_source()) == ("cart/1", "urn:dropanchor:site:yard")
    assert event.get_extension("sequence") == "1".zfill(20)
    time, data = event.get_time(), event.get_data()
    assert time is not None
    assert isinstance(data, dict)
    assert data["zone"] == "dock"
    assert round(time.timestamp() * 1e6) == data["t_ns"] // 1000
