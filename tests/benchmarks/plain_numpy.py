"""The steps of the alternation in plain numpy, as one would write them first: the measure of the compiled ones."""

from __future__ import annotations

import sys
from itertools import chain, combinations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))


from pipeline.core.shape.photometric.sight import Sight

Array = NDArray[Any]
CHUNK = 500  # pixels at a time


def refine(sight: Sight, certainty: Array, table: Array, steps: int, normals: Array) -> tuple[Array, Array]:
    """Return normals and weights of every pixel after damped Gauss-Newton steps; one set of weights, coloured table."""
    found, weights = normals.copy(), np.empty((len(normals), table.shape[2]))
    for start in range(0, len(normals), CHUNK):
        own = slice(start, start + CHUNK)
        found[own], weights[own] = _refine(sight.select(own), certainty[own], table, steps, normals[own])
    return found, weights


def gather(sight: Sight, certainty: Array, normals: Array, weights: Array, shape: tuple[int, ...]) -> Array:
    """Return the normal matrix of the table's nodes as a band (N, W)."""
    nodes_h, nodes_d, bases = shape[:3]
    band = np.zeros((nodes_h * nodes_d * bases, (nodes_d + 2) * bases))
    for start in range(0, len(normals), CHUNK):
        own = slice(start, start + CHUNK)
        part = sight.select(own)
        wi, half, difference = _directions(part)
        cosine = np.maximum(_dot(wi, normals[own]), 0) * np.sqrt(certainty[own])
        i, a, j, b = _cells(_dot(half, normals[own]), difference, nodes_h, nodes_d)
        node = np.stack([(i + di) * nodes_d + j + dj for di in (0, 1) for dj in (0, 1)], axis=-1)
        share = np.stack([(1 - a) * (1 - b), (1 - a) * b, a * (1 - b), a * b], axis=-1) * cosine[..., None]
        for s in range(4):
            for t in range(s, 4):
                product = share[..., s] * share[..., t]
                for q in range(bases):
                    for r in range(bases):
                        row, offset = node[..., s] * bases + q, (node[..., t] - node[..., s]) * bases + r - q
                        value = product * (weights[own, q] * weights[own, r])[:, None]
                        kept = offset >= 0
                        np.add.at(band, (row[kept], offset[kept]), value[kept])
    return band


def _refine(sight: Sight, certainty: Array, table: Array, steps: int, normals: Array) -> tuple[Array, Array]:
    wi, half, difference = _directions(sight)
    columns, slopes = _columns(normals, wi, half, difference, table)
    weights, gram, best = _weigh(columns, sight.values, certainty)
    damping = np.full(len(normals), 1e-3)
    for _ in range(steps):
        tangents = _tangents(normals)
        model = np.einsum("plks,pk->pls", columns, weights)
        slope = np.einsum("plks,pk->pls", slopes, weights)
        cosine = np.maximum(_dot(wi, normals), 1e-9)
        across_h, across_l = (np.einsum("pli,pti->plt", v, tangents) for v in (half, wi))
        moved = slope[..., None] * across_h[:, :, None] + (model / cosine[..., None])[..., None] * across_l[:, :, None]
        weighted = moved * certainty[:, :, None, None]
        system = np.einsum("plst,plsu->ptu", weighted, moved)
        right = np.einsum("plst,pls->pt", weighted, sight.values - model)
        mixed = np.einsum("plks,plst->pkt", columns, weighted) * (weights > 0)[..., None]
        used = gram * (weights > 0)[:, :, None] * (weights > 0)[:, None]
        used += (
            np.eye(gram.shape[1])
            * (np.where(weights > 0, 1e-12, 1) * np.trace(gram, axis1=1, axis2=2)[:, None])[:, :, None]
        )
        system -= mixed.transpose(0, 2, 1) @ np.linalg.solve(used, mixed)
        system *= 1 + np.eye(2) * damping[:, None, None]
        step = np.linalg.solve(system + 1e-30 * np.eye(2), right[..., None])[..., 0]
        length = np.linalg.norm(step, axis=1, keepdims=True)
        step *= np.minimum(1, 0.2 / np.maximum(length, 1e-30))
        trial = normals + np.einsum("pt,pti->pi", step, tangents)
        trial /= np.linalg.norm(trial, axis=1, keepdims=True)
        tried_columns, tried_slopes = _columns(trial, wi, half, difference, table)
        tried, tried_gram, cost = _weigh(tried_columns, sight.values, certainty)
        better = cost < best
        normals, best = np.where(better[:, None], trial, normals), np.where(better, cost, best)
        columns = np.where(better[:, None, None, None], tried_columns, columns)
        slopes = np.where(better[:, None, None, None], tried_slopes, slopes)
        weights, gram = np.where(better[:, None], tried, weights), np.where(better[:, None, None], tried_gram, gram)
        damping = np.where(better, 0.1 * damping, np.maximum(10 * damping, 0.1))
    return normals, weights


def _directions(sight: Sight) -> tuple[Array, Array, Array]:
    wi = sight.lights - sight.points[:, None] if sight.near else np.broadcast_to(sight.lights, sight.values.shape)
    wi = wi / np.linalg.norm(wi, axis=2, keepdims=True)
    half = wi + sight.views[:, None]
    half /= np.linalg.norm(half, axis=2, keepdims=True)
    return wi, half, np.arccos(np.sqrt(np.clip(0.5 + 0.5 * _dot(wi, sight.views), 0, 1))) / (np.pi / 2)


def _columns(normals: Array, wi: Array, half: Array, difference: Array, table: Array) -> tuple[Array, Array]:
    cosine, middle = np.maximum(_dot(wi, normals), 0), _dot(half, normals)
    nodes_h, nodes_d = table.shape[:2]
    i, a, j, b = _cells(middle, difference, nodes_h, nodes_d)
    a, b = a[..., None, None], b[..., None, None]
    low = (1 - b) * table[i, j] + b * table[i, j + 1]
    high = (1 - b) * table[i + 1, j] + b * table[i + 1, j + 1]
    rate = -cosine * (nodes_h - 1) * np.maximum(1 - middle, 0) ** 0.25 / (4 * np.maximum(1 - middle, 1e-9))
    return cosine[..., None, None] * (low + a * (high - low)), rate[..., None, None] * (high - low)


def _cells(middle: Array, difference: Array, nodes_h: int, nodes_d: int) -> tuple[Array, Array, Array, Array]:
    u, v = np.maximum(1 - middle, 0) ** 0.25 * (nodes_h - 1), difference * (nodes_d - 1)
    i, j = np.minimum(u.astype(int), nodes_h - 2), np.minimum(v.astype(int), nodes_d - 2)
    return i, u - i, j, v - j


def _weigh(columns: Array, values: Array, certainty: Array) -> tuple[Array, Array, Array]:
    weighted = columns * certainty[..., None, None]
    gram = np.einsum("plks,plms->pkm", weighted, columns)
    moments = np.einsum("plks,pls->pk", weighted, values)
    bases = gram.shape[1]
    best, weights = np.zeros(len(gram)), np.zeros((len(gram), bases))
    for support in chain.from_iterable(combinations(range(bases), n) for n in range(1, bases + 1)):
        own = np.array(support)
        system = gram[:, own[:, None], own]
        size = np.trace(system, axis1=1, axis2=2)[:, None, None]
        x = np.linalg.solve(system + 1e-12 * (size + 1e-300) * np.eye(len(own)), moments[:, own, None])[..., 0]
        gain = (x * moments[:, own]).sum(axis=1)
        better = (x >= 0).all(axis=1) & (gain > best)
        best = np.where(better, gain, best)
        weights[better] = 0
        weights[np.ix_(better, own)] = x[better]
    total = (certainty[..., None] * values.astype(np.float64) ** 2).sum(axis=(1, 2))
    return weights, gram, total - best


def _tangents(normals: Array) -> Array:
    axis = np.where(np.abs(normals[:, :1]) < 0.7, [1.0, 0, 0], [0, 1.0, 0])
    first = np.cross(normals, axis)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(normals, first)], axis=1)


def _dot(vectors: Array, normals: Array) -> Array:
    return np.asarray((vectors * normals[:, None]).sum(axis=2))
