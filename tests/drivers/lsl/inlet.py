"""Somebody else's program that records both streams of a device; it knows nothing of grabberd.

python inlet.py DEVICE OUT: prints "open" once both are open, records until a capture has ended, writes OUT.
"""

import json
import sys
import threading

import numpy as np
import pylsl

PATIENCE_S = 60.0


def recorded(inlet: pylsl.StreamInlet, ended: threading.Event) -> tuple[list, list]:
    samples, times_s = [], []
    while not ended.is_set():
        sample, time_s = inlet.pull_sample(0.2)
        if sample is None:
            continue
        samples.append(sample)
        times_s.append(time_s)
        if isinstance(sample[0], str) and json.loads(sample[0])["event"] == "capture_ended":
            ended.set()
    more, more_times_s = inlet.pull_chunk(0.0, max_samples=100_000)
    return samples + more, times_s + more_times_s


def opened(name: str) -> pylsl.StreamInlet:
    [info] = pylsl.resolve_byprop("name", name, 1, PATIENCE_S)
    inlet = pylsl.StreamInlet(info, 360, recover=False)
    inlet.open_stream(PATIENCE_S)
    return inlet


def main(device: str, out: str) -> None:
    points, events = opened(f"grabberd-{device}-points"), opened(f"grabberd-{device}-events")
    described = points.info(PATIENCE_S).as_xml(), events.info(PATIENCE_S).as_xml()
    correction_s = points.time_correction(PATIENCE_S)
    ended, found = threading.Event(), {}

    def record(name: str, inlet: pylsl.StreamInlet) -> None:
        found[name] = recorded(inlet, ended)

    threads = [threading.Thread(target=record, args=one) for one in (("points", points), ("events", events))]
    for one in threads:
        one.start()
    print("open", flush=True)
    for one in threads:
        one.join()
    np.savez(
        out,
        samples=np.array(found["points"][0], np.float32),
        times_s=np.array(found["points"][1], float),
        events=np.array([text for [text] in found["events"][0]]),
        event_times_s=np.array(found["events"][1], float),
        described=np.array(described),
        correction_s=correction_s,
    )


if __name__ == "__main__":
    main(*sys.argv[1:])
