"""The gait-state classifier: a directed graph network over keypoints and links (paper, II.D).

After Shi, Zhang, Cheng, Lu, "Skeleton-Based Action Recognition with Directed Graph Neural Networks", CVPR 2019,
with the paper's widths. The temporal convolutions use no padding and together see exactly 15 frames, so that
one pass over T frames gives the answers of all its T - 14 windows.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Final

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor, nn

from anticipation.motion import WINDOW, Settings
from perception.skeleton import LINKS

VERTICES: Final = 12
CLASS_COUNT: Final = 3  # stable, transient, fall


def incidence(links: ArrayLike, vertices: int = VERTICES) -> tuple[Tensor, Tensor]:
    """Return the source and the target incidence matrix (V, E) of links given as (E, 2) [source, target].

    Column j belongs to link j, in the order given; entry (i, j) is 1 where vertex i is link j's source
    (respectively its target) and exactly 0 everywhere else.
    """
    ends = torch.tensor(np.array(links, dtype=np.int64))
    source, target = torch.zeros(2, vertices, len(ends))
    columns = torch.arange(len(ends))
    source[ends[:, 0], columns] = 1.0
    target[ends[:, 1], columns] = 1.0
    return source, target


class DirectedGraph(nn.Module):
    """Source and target incidence of one block: the skeleton plus a learnable offset that starts at zero.

    A vertex takes the mean over its outgoing (incoming) links; a link takes its source (target) vertex.
    The offset is added before the division by the number of links, and is frozen until
    `DirectedGraphNetwork.set_graph_trainable(True)`.
    """

    source: Tensor
    target: Tensor
    source_count: Tensor
    target_count: Tensor

    def __init__(self, links: ArrayLike) -> None:
        super().__init__()
        source, target = incidence(links)
        self.register_buffer("source", source, persistent=False)
        self.register_buffer("target", target, persistent=False)
        self.register_buffer("source_count", source.sum(1, keepdim=True).clamp(min=1), persistent=False)
        self.register_buffer("target_count", target.sum(1, keepdim=True).clamp(min=1), persistent=False)
        self.source_offset = nn.Parameter(torch.zeros_like(source), requires_grad=False)
        self.target_offset = nn.Parameter(torch.zeros_like(target), requires_grad=False)

    def matrices(self) -> tuple[Tensor, Tensor]:
        """Return the source and target incidence with what was learnt, each (V, E)."""
        return self.source + self.source_offset, self.target + self.target_offset

    def links_at_vertices(self, edges: Tensor) -> tuple[Tensor, Tensor]:
        """Mean of incoming and of outgoing links at each vertex: (..., E, C) -> two (..., V, C)."""
        source, target = self.matrices()
        return (target / self.target_count) @ edges, (source / self.source_count) @ edges

    def ends_of_links(self, vertices: Tensor) -> tuple[Tensor, Tensor]:
        """Source and target vertex of each link: (..., V, C) -> two (..., E, C)."""
        source, target = self.matrices()
        return source.T @ vertices, target.T @ vertices


class TemporalConvolution(nn.Module):
    """Convolution over time alone, without padding: (B, T, N, C) -> (B, T - kernel + 1, N, C)."""

    def __init__(self, width: int, kernel: int) -> None:
        super().__init__()
        self.convolution = nn.Conv2d(width, width, (kernel, 1), bias=False)

    def forward(self, x: Tensor) -> Tensor:
        """Convolve; the permuted view is what torch calls channels-last, nothing is copied."""
        convolved: Tensor = self.convolution(x.permute(0, 3, 1, 2))
        return convolved.permute(0, 2, 3, 1)


class ChannelNorm(nn.Module):
    """Batch norm over the last axis of (B, T, N, C): one mean and variance per channel."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.norm = nn.BatchNorm2d(width)

    def forward(self, x: Tensor) -> Tensor:
        """Normalise each channel."""
        normed: Tensor = self.norm(x.permute(0, 3, 1, 2))
        return normed.permute(0, 2, 3, 1)


class Stream(nn.Module):
    """What a block does to one stream: update from its neighbours, convolve in time, add the block's input.

    Vertices and edges follow different distributions, so each stream has norms of its own.
    """

    def __init__(self, width_in: int, width_neighbour: int, width_out: int, kernel: int) -> None:
        super().__init__()
        self.kernel = kernel
        self.update = nn.Linear(width_in + 2 * width_neighbour, width_out, bias=False)
        self.update_norm = ChannelNorm(width_out)
        self.time = TemporalConvolution(width_out, kernel)
        self.time_norm = ChannelNorm(width_out)
        self.shortcut = nn.Identity() if width_in == width_out else nn.Linear(width_in, width_out)

    def updated(self, own: Tensor, first: Tensor, second: Tensor) -> Tensor:
        """One layer on the concatenation: three (B, T, N, ...) -> (B, T, N, C_out)."""
        return torch.relu(self.update_norm(self.update(torch.cat((own, first, second), dim=-1))))

    def convolved(self, updated: Tensor, entered: Tensor) -> Tensor:
        """Convolve (B, T, N, C_out) over time and add the newest T - kernel + 1 frames of the block's input."""
        return torch.relu(self.time_norm(self.time(updated)) + self.shortcut(entered[:, self.kernel - 1 :]))


class DirectedGraphBlock(nn.Module):
    """Update vertices from their links and links from their updated vertices (Shi et al., eqs. 1-4), then time."""

    def __init__(self, width_in: int, width_out: int, kernel: int, links: ArrayLike) -> None:
        super().__init__()
        self.graph = DirectedGraph(links)
        self.vertex = Stream(width_in, width_in, width_out, kernel)
        self.edge = Stream(width_in, width_out, width_out, kernel)

    def forward(self, vertices: Tensor, edges: Tensor) -> tuple[Tensor, Tensor]:
        """(B, T, V, C_in) and (B, T, E, C_in) -> the same with C_out and T - kernel + 1 frames."""
        incoming, outgoing = self.graph.links_at_vertices(edges)
        new_vertices = self.vertex.updated(vertices, incoming, outgoing)
        sources, targets = self.graph.ends_of_links(new_vertices)
        new_edges = self.edge.updated(edges, sources, targets)
        return self.vertex.convolved(new_vertices, vertices), self.edge.convolved(new_edges, edges)


class DirectedGraphNetwork(nn.Module):
    """Gait state of every window of 15 frames: (B, T, 13, 2) -> logits (B, T - 14, 3).

    Vertices are the keypoints relative to the upper-body centre in body lengths; edges are the bone vectors, target
    minus source. With `centre` every vertex also has the centre's velocity through the image, row 12 of a frame, as
    two more channels: relative coordinates alone do not say that the body descends. Without it, as in the paper, rows
    beyond the keypoints are not looked at.
    Logits are in the order stable, transient, fall; entry t belongs to frames t .. t + 14.
    """

    source: Tensor
    target: Tensor

    def __init__(
        self,
        centre: bool = False,
        widths: Sequence[int] = (16, 32, 64),
        kernels: Sequence[int] = (5, 5, 7),
        dropout: float = 0.5,
        links: ArrayLike = LINKS,
    ) -> None:
        super().__init__()
        reach = 1 + sum(kernel - 1 for kernel in kernels)
        if reach != WINDOW or len(kernels) != len(widths):
            raise ValueError(f"kernels {tuple(kernels)} see {reach} frames in {len(widths)} blocks, expected {WINDOW}")
        self.settings: Settings = {
            "centre": centre, "widths": list(widths), "kernels": list(kernels), "dropout": dropout,
        }  # fmt: skip
        self.centre = centre
        in_channels = 4 if centre else 2
        ends = torch.tensor(np.array(links, dtype=np.int64))
        self.register_buffer("source", ends[:, 0].clone(), persistent=False)
        self.register_buffer("target", ends[:, 1].clone(), persistent=False)
        self.vertex_norm = ChannelNorm(in_channels)
        self.edge_norm = ChannelNorm(in_channels)
        entering = (in_channels, *widths[:-1])
        self.blocks = nn.ModuleList(
            DirectedGraphBlock(width_in, width_out, kernel, links)
            for width_in, width_out, kernel in zip(entering, widths, kernels, strict=True)
        )
        self.dropout = nn.Dropout(dropout)
        self.head = nn.Linear(2 * widths[-1], CLASS_COUNT)

    def set_graph_trainable(self, trainable: bool) -> None:
        """Let the incidence offsets learn, or freeze them as Shi et al. do in the first epochs."""
        for name, parameter in self.named_parameters():
            if name.endswith(("source_offset", "target_offset")):
                parameter.requires_grad_(trainable)

    def entering(self, frames: Tensor) -> Tensor:
        """What enters at the vertices: frames (B, T, 13, 2) -> (B, T, 12, 2), or (B, T, 12, 4) with the centre."""
        poses = frames[:, :, :VERTICES]
        if not self.centre:
            return poses
        return torch.cat((poses, frames[:, :, VERTICES:].expand_as(poses)), dim=-1)

    def embedding(self, frames: Tensor) -> Tensor:
        """Mean over vertices beside mean over edges after the last block: (B, T, 13, 2) -> (B, T - 14, 128)."""
        entering = self.entering(frames)  # (B, T, V, C)
        bones = entering[:, :, self.target] - entering[:, :, self.source]  # (B, T, E, C)
        vertices, edges = self.vertex_norm(entering), self.edge_norm(bones)
        for block in self.blocks:
            vertices, edges = block(vertices, edges)
        return torch.cat((vertices.mean(dim=2), edges.mean(dim=2)), dim=-1)

    def forward(self, frames: Tensor) -> Tensor:
        """Logits (B, T - 14, 3) of frames (B, T, 13, 2), T >= 15."""
        logits: Tensor = self.head(self.dropout(self.embedding(frames)))
        return logits


CLASSIFIERS: Final[Mapping[str, Callable[..., DirectedGraphNetwork]]] = {"dgnn": DirectedGraphNetwork}
"""Classifiers by the name a checkpoint carries; the constructor takes the module's `settings`."""
