"""The directed graph classifier: one pass equals many, and the graph is the skeleton's."""

import numpy as np
import pytest
import torch

from anticipation.gait_state import DirectedGraphNetwork, incidence
from perception.skeleton import LINKS


def shaken(network: DirectedGraphNetwork) -> DirectedGraphNetwork:
    """Give norms and offsets values that an error could not hide behind; ready to evaluate."""
    torch.manual_seed(1)
    with torch.no_grad():
        for name, value in (*network.named_parameters(), *network.named_buffers()):
            if "running_var" in name:
                value.uniform_(0.5, 2.0)
            elif "norm" in name and value.is_floating_point():
                value.normal_(0.5, 0.5)
    return network.eval()


@pytest.fixture
def network() -> DirectedGraphNetwork:
    torch.manual_seed(0)
    return shaken(DirectedGraphNetwork())


@pytest.mark.parametrize("frames", [15, 16, 30, 41])
def test_one_pass_equals_the_windows_one_by_one(network, frames):
    sequence = torch.randn(2, frames, 12, 2)
    windows = [network(sequence[:, first : first + 15]) for first in range(frames - 14)]
    together = network(sequence)
    assert together.shape == (2, frames - 14, 3)
    torch.testing.assert_close(together, torch.cat(windows, dim=1), atol=1e-5, rtol=0)


def test_a_window_is_judged_by_its_fifteen_frames_and_by_all_of_them(network):
    sequence = torch.randn(1, 30, 12, 2, requires_grad=True)
    network(sequence)[0, 7].sum().backward()
    felt = sequence.grad.abs().sum(dim=(0, 2, 3)) > 0
    assert felt.tolist() == [7 <= frame <= 21 for frame in range(30)]


def test_kernels_that_do_not_see_fifteen_frames_are_refused():
    with pytest.raises(ValueError, match="see 13 frames"):
        DirectedGraphNetwork(kernels=(5, 5, 5))


def test_only_with_the_centre_is_its_velocity_looked_at(network):
    """The paper's network reads the keypoints of a frame, whether or not something follows them."""
    frames = torch.randn(2, 20, 13, 2)
    faster = frames.clone()
    faster[:, 10, 12] += 1.0
    assert torch.equal(network(frames), network(faster))
    assert torch.equal(network(frames), network(frames[:, :, :12]))
    seeing = shaken(DirectedGraphNetwork(centre=True))
    changed = (seeing(frames) != seeing(faster)).any(dim=2)
    assert changed.all()  # frame 10 is in each of the six windows


def test_embedding_is_what_the_last_layer_sees(network):
    sequence = torch.randn(2, 18, 12, 2)
    embedding = network.embedding(sequence)
    assert embedding.shape == (2, 4, 128)
    torch.testing.assert_close(network.head(embedding), network(sequence))


def test_incidence_has_one_source_and_one_target_in_each_column():
    source, target = incidence(LINKS)
    for edge, (tail, tip) in enumerate(LINKS):
        assert source[:, edge].nonzero().flatten().tolist() == [tail]
        assert target[:, edge].nonzero().flatten().tolist() == [tip]
    assert source.sum() == target.sum() == len(LINKS)


def test_reversing_a_link_swaps_its_columns():
    flipped = np.array(LINKS)
    flipped[3] = flipped[3, ::-1]
    (source, target), (source_2, target_2) = incidence(LINKS), incidence(flipped)
    assert torch.equal(source[:, 3], target_2[:, 3])
    assert torch.equal(target[:, 3], source_2[:, 3])
    others = [edge for edge in range(12) if edge != 3]
    assert torch.equal(source[:, others], source_2[:, others])


def test_direction_matters(network):
    reversed_links = shaken(DirectedGraphNetwork(links=LINKS[:, ::-1].copy()))
    reversed_links.load_state_dict(network.state_dict())
    frames = torch.randn(1, 15, 12, 2)
    assert not torch.allclose(network(frames), reversed_links(frames), atol=1e-3)


def test_the_order_of_links_does_not_matter(network):
    order = np.random.default_rng(0).permutation(12)
    shuffled = shaken(DirectedGraphNetwork(links=LINKS[order]))
    shuffled.load_state_dict(network.state_dict())
    frames = torch.randn(2, 17, 12, 2)
    torch.testing.assert_close(network(frames), shuffled(frames), atol=1e-5, rtol=1e-5)


def test_the_names_of_vertices_do_not_matter(network):
    """Renumbering keypoints and links together changes nothing: no layer knows a joint but by its links."""
    order = np.random.default_rng(1).permutation(12)  # new vertex k is old vertex order[k]
    renamed = shaken(DirectedGraphNetwork(links=np.argsort(order)[LINKS]))
    renamed.load_state_dict(network.state_dict())
    frames = torch.randn(2, 17, 12, 2)
    torch.testing.assert_close(network(frames), renamed(frames[:, :, order]), atol=1e-5, rtol=1e-5)


def test_edges_are_bones_target_minus_source(network):
    """So moving the whole skeleton changes no edge."""
    frames = torch.randn(1, 15, 12, 2)
    seen = []
    network.edge_norm.register_forward_hook(lambda _m, inputs, _o: seen.append(inputs[0]))
    network(frames)
    network(frames + 3.0)
    torch.testing.assert_close(seen[0], seen[1], atol=1e-5, rtol=0)
    expected = frames[:, :, LINKS[:, 1].copy()] - frames[:, :, LINKS[:, 0].copy()]
    assert torch.equal(seen[0], expected)


def test_news_travel_along_links_only():
    """One block lets a vertex hear of its neighbours' links and no further."""
    block = DirectedGraphNetwork().blocks[0].eval()
    vertices, edges = torch.randn(2, 1, 5, 12, 2)
    edges.requires_grad_()
    block(vertices, edges)[0][0, 0, 4].sum().backward()  # vertex 4: the left wrist
    heard = edges.grad.abs().sum(dim=(0, 1, 3)).nonzero().flatten().tolist()
    assert heard == [edge for edge, ends in enumerate(LINKS) if 4 in ends]


def test_vertices_average_over_their_links():
    graph = DirectedGraphNetwork().blocks[0].graph
    incoming, outgoing = graph.links_at_vertices(torch.ones(1, 12, 3))
    source, target = incidence(LINKS)
    assert torch.equal(incoming[0, :, 0], (target.sum(1) > 0).float())
    assert torch.equal(outgoing[0, :, 0], (source.sum(1) > 0).float())
    tails, tips = graph.ends_of_links(torch.arange(12.0).reshape(1, 12, 1))
    assert tails[0, :, 0].tolist() == LINKS[:, 0].tolist()
    assert tips[0, :, 0].tolist() == LINKS[:, 1].tolist()


def test_the_graph_is_frozen_until_told_and_then_learns():
    network = DirectedGraphNetwork()
    offsets = {name: p for name, p in network.named_parameters() if "offset" in name}
    assert len(offsets) == 2 * len(network.blocks)
    assert all(not p.requires_grad and not p.any() for p in offsets.values())
    network.set_graph_trainable(True)
    network(torch.randn(4, 15, 12, 2)).pow(2).sum().backward()
    assert all(p.grad is not None and p.grad.any() for p in offsets.values())
    network.set_graph_trainable(False)
    assert not any(p.requires_grad for p in offsets.values())
    assert all(p.requires_grad for name, p in network.named_parameters() if "offset" not in name)


def test_each_stream_has_norms_of_its_own_sized_by_channel():
    network = DirectedGraphNetwork()
    norms = {name: m for name, m in network.named_modules() if isinstance(m, torch.nn.BatchNorm2d)}
    assert len(norms) == 2 + 4 * len(network.blocks)
    assert {m.num_features for m in norms.values()} == {2, 16, 32, 64}
    assert sum("edge" in name for name in norms) == sum("vertex" in name for name in norms)


def test_settings_rebuild_the_same_network(network):
    again = DirectedGraphNetwork(**network.settings)
    again.load_state_dict(network.state_dict())
    frames = torch.randn(1, 15, 12, 2)
    assert torch.equal(again.eval()(frames), network(frames))


def test_the_paper_s_sizes():
    network = DirectedGraphNetwork()
    assert [block.vertex.update.out_features for block in network.blocks] == [16, 32, 64]
    assert (network.head.in_features, network.head.out_features) == (128, 3)
    assert network.dropout.p == 0.5
