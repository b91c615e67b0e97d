import numpy as np

from perception.skeleton import COCO_INDEX, LINKS, MIRROR, NAMES


def test_links_are_those_of_the_design_in_its_order() -> None:
    design = [
        (5, 7),
        (7, 9),
        (6, 8),
        (8, 10),
        (11, 13),
        (13, 15),
        (12, 14),
        (14, 16),
        (5, 6),
        (11, 12),
        (5, 11),
        (6, 12),
    ]
    assert [tuple(COCO_INDEX[link]) for link in LINKS] == design


def test_mirror_swaps_left_and_right_and_maps_links_onto_links() -> None:
    assert np.array_equal(MIRROR[MIRROR], np.arange(12))
    for name, other in zip(NAMES, np.array(NAMES)[MIRROR], strict=True):
        assert {name[:2], other[:2]} == {"l_", "r_"}
        assert name[2:] == other[2:]
    undirected = {frozenset(link) for link in LINKS.tolist()}
    assert {frozenset(MIRROR[list(link)].tolist()) for link in undirected} == undirected


def test_links_have_no_directed_cycle() -> None:
    remaining = {tuple(link) for link in LINKS.tolist()}
    vertices = set(range(12))
    while vertices:
        sources = {v for v in vertices if all(target != v for _, target in remaining)}
        assert sources, "every remaining vertex has an incoming link: a cycle"
        vertices -= sources
        remaining = {link for link in remaining if link[0] not in sources}
