"""What the paper reports of itself and of others, on an 80/20 split that it does not say is by recording.

Cho et al., "Anticipatory Fall Detection in Humans with Hybrid Directed Graph Neural Networks and Long Short-Term
Memory", 2025, Tables 2 and 3.
"""

from __future__ import annotations

from typing import Final

HORIZONS_MS: Final = (0, 100, 200, 300, 400, 500)
ERROR: Final = (0.0, 0.031, 0.031, 0.0327, 0.029, 0.034)  # normalised; by which length is not said
ERROR_SPREAD: Final = (0.0, 0.010, 0.006, 0.005, 0.007, 0.007)
ACCURACY: Final[dict[str, tuple[float | None, ...]]] = {
    "DGNN only": (0.958, 0.912, 0.908, 0.814, 0.785, 0.764),
    "LSTM + DGNN (proposed)": (0.958, 0.912, 0.886, 0.900, 0.888, 0.894),
    "CNN (Xu 2020), 2 classes": (0.917, None, None, None, None, None),
    "VGG16 (Chhetri 2021), 2 classes": (0.951, None, None, None, None, None),
    "RNN (Theodoridis 2018), 2 classes": (0.928, None, None, None, None, None),
    "ConvAutoencoder (Cai 2020), 2 classes": (0.962, None, None, None, None, None),
}
