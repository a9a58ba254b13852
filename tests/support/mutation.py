"""Bytes with random changes, and the answers of a reader to them."""

from hypothesis import strategies as st


def mutated(data, whole):
    """Some bytes changed, put in or taken out; maybe without the line that would tell."""
    changed = bytearray(whole)
    if data.draw(st.booleans()) and b"# rows" in changed:
        start = changed.index(b"# rows")
        del changed[start : changed.index(b"\n", start) + 1]
    pieces = st.one_of(
        st.binary(max_size=8),
        st.sampled_from([b"\n", b",", b'"', b"#", b"9" * 30, b"nan", b"-1", b"1e999", b"\0", b"\xff", b"# shapes "]),
    )
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(changed)))
        changed[at : at + data.draw(st.integers(0, 8))] = data.draw(pieces)
    return bytes(changed[: data.draw(st.one_of(st.just(len(changed)), st.integers(0, len(changed))))])


def said_by(read):
    """The one sentence of a refusal; any other error is one of the test."""
    try:
        read()
    except ValueError as error:
        return str(error) or "nothing"
    return ""
