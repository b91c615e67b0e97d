"""The classifier as a running node uses it: one or two sequences at a time, the same numbers with less work.

At such batch sizes the arithmetic is small and the calls are many, so batch norms are folded into the layers before
them, shortcut and convolution are one product, and vertices and edges share it. A test holds the numbers equal to
those of the module.
"""

from __future__ import annotations

from typing import NamedTuple, cast

import torch
from torch import Tensor, nn

from anticipation.gait_state import ChannelNorm, DirectedGraphBlock, DirectedGraphNetwork, Stream, incidence


class Judgement(NamedTuple):
    """The classifier's view of every window of sequences of T frames."""

    embedding: Tensor  # (B, T - 14, 128)
    logits: Tensor  # (B, T - 14, 3)


class FastDirectedGraph:
    """`DirectedGraphNetwork` in evaluation mode for few sequences: (B, T, 13, 2) -> `Judgement`.

    It keeps copies of the weights: later training does not reach it.

    Vertices and edges, twelve of each, are the two entries of the first axis of X (2, 12, B, T, C).
    """

    def __init__(self, network: DirectedGraphNetwork) -> None:
        with torch.no_grad():
            source, target = incidence(torch.stack((network.source, network.target), dim=1).numpy())
            self._entering = network.entering
            self._bones = (target - source).T.contiguous()  # (E, V)
            norms = [_affine(norm) for norm in (network.vertex_norm, network.edge_norm)]
            self._scale = torch.stack([scale for scale, _ in norms])[:, None, None, None]  # (2, 1, 1, 1, C)
            self._shift = torch.stack([shift for _, shift in norms])[:, None, None, None]
            self._blocks = [_FastBlock(cast(DirectedGraphBlock, block)) for block in network.blocks]
            self._bias, self._head = network.head.bias.clone(), network.head.weight.T.contiguous()

    def __call__(self, frames: Tensor) -> Judgement:
        """Judge every window of frames (B, T, 13, 2)."""
        vertices = self._entering(frames).permute(2, 0, 1, 3).contiguous()  # (12, B, T, C)
        edges = (self._bones @ vertices.flatten(1)).view_as(vertices)
        X = torch.addcmul(self._shift, torch.stack((vertices, edges)), self._scale)
        for block in self._blocks:
            X = block(X)
        embedding = X.mean(dim=1).permute(1, 2, 0, 3).flatten(2)  # (B, T - 14, 2 x 64)
        logits = torch.addmm(self._bias, embedding.flatten(0, 1), self._head)
        return Judgement(embedding, logits.view(*embedding.shape[:2], -1))


class _FastBlock:
    """`DirectedGraphBlock` for X (2, 12, B, T, C_in) -> (2, 12, B, T - kernel + 1, C_out)."""

    def __init__(self, block: DirectedGraphBlock) -> None:
        source, target = block.graph.matrices()
        self._at_vertices = torch.cat((target / block.graph.target_count, source / block.graph.source_count))  # (24, E)
        self._at_edges = torch.cat((source.T, target.T))  # (24, V)
        self._vertex, self._vertex_bias = _update(block.vertex)
        self._edge, self._edge_bias = _update(block.edge)
        streams = [_convolution(stream) for stream in (block.vertex, block.edge)]
        self._time = torch.stack([weight for weight, _ in streams])  # (2, kernel C_out + C_in, C_out)
        self._time_bias = torch.stack([bias for _, bias in streams])[:, None]  # (2, 1, C_out)
        self._kernel = block.vertex.kernel
        self._width = block.vertex.update.out_features

    def __call__(self, X: Tensor) -> Tensor:
        vertices, edges = X.unbind()
        _, nodes, B, T, _ = X.shape
        Y = X.new_empty(2, nodes, B, T, self._width)
        self._mix(self._at_vertices, edges, vertices, self._vertex, self._vertex_bias, Y[0])
        self._mix(self._at_edges, Y[0], edges, self._edge, self._edge_bias, Y[1])
        # kernel successive frames of C channels lie one behind the other in memory: windows are a view
        steps, reach = T - self._kernel + 1, self._kernel * self._width
        windows = Y.as_strided((2, nodes, B, steps, reach), (*Y.stride()[:4], 1))
        columns = torch.cat((windows, X[:, :, :, self._kernel - 1 :]), dim=-1).flatten(1, 3)
        Z = torch.baddbmm(self._time_bias, columns, self._time).relu_()
        return Z.view(2, nodes, B, steps, self._width)

    @staticmethod
    def _mix(graph: Tensor, neighbours: Tensor, own: Tensor, weight: Tensor, bias: Tensor, out: Tensor) -> None:
        """One layer on [own, first neighbours, second neighbours], written to `out` (12, B, T, C_out)."""
        first, second = (graph @ neighbours.flatten(1)).view(2, *neighbours.shape).unbind()
        entered = torch.cat((own, first, second), dim=-1).flatten(0, 2)
        torch.addmm(bias, entered, weight, out=out.view(-1, out.shape[-1])).relu_()


def _affine(norm: ChannelNorm) -> tuple[Tensor, Tensor]:
    """Batch norm in evaluation mode as x * scale + shift, each (C,)."""
    statistics = norm.norm
    assert statistics.running_mean is not None and statistics.running_var is not None  # noqa: PT018
    scale = statistics.weight / torch.sqrt(statistics.running_var + statistics.eps)
    return scale, statistics.bias - statistics.running_mean * scale


def _update(stream: Stream) -> tuple[Tensor, Tensor]:
    """Update layer and its norm as one weight (entering, C_out) and bias (C_out,)."""
    scale, shift = _affine(stream.update_norm)
    return (stream.update.weight * scale[:, None]).T.contiguous(), shift


def _convolution(stream: Stream) -> tuple[Tensor, Tensor]:
    """Convolution, its norm and the shortcut as one weight (kernel C_out + C_in, C_out) and bias (C_out,)."""
    scale, shift = _affine(stream.time_norm)
    kernel = stream.time.convolution.weight[..., 0] * scale[:, None, None]  # (C_out, C, kernel)
    weight = kernel.permute(2, 1, 0).flatten(0, 1)  # rows: frame by frame, channel by channel
    if isinstance(stream.shortcut, nn.Linear):
        return torch.cat((weight, stream.shortcut.weight.T)), shift + stream.shortcut.bias
    return torch.cat((weight, torch.eye(len(scale)))), shift
