"""Networks this small are quicker on one thread, most of all where other tests run beside them."""

import torch

torch.set_num_threads(1)
