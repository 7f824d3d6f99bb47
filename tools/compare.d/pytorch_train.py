"""Training steps in PyTorch, for tools/compare --train; runs in the virtual environment of tools/compare.

    pytorch_train.py small STEPS             the package's da3-small: 2 images of 504x280, L1 on depth and rays
    pytorch_train.py nano STEPS ORACLE       the network in ORACLE/omnix_v2.py: 4 images of 140x84, geometry, trajectories, scores

Random weights and numbers; forward, backward and AdamW, f32. Prints the seconds of every step as JSON.
"""

import json
import os
import sys
import time
import warnings

warnings.simplefilter("ignore")
# The package logs to standard output.
answers = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)

import torch


def small():
    from depth_anything_3.cfg import create_object, load_config
    from depth_anything_3.registry import MODEL_REGISTRY

    network = create_object(load_config(MODEL_REGISTRY["da3-small"])).train()
    pictures = torch.randn(1, 2, 3, 280, 504)
    depth, ray = torch.rand(1, 2, 280, 504) + 0.5, torch.randn(1, 2, 160, 288, 6)

    def loss():
        features, _ = network.backbone(pictures, cam_token=None, export_feat_layers=[], ref_view_strategy="first")
        found = network.head(features, 280, 504, patch_start_idx=0)
        return (found["depth"] - depth).abs().mean() + (found["ray"] - ray).abs().mean()

    return network, loss


def nano(oracle):
    sys.path.insert(0, oracle)
    import omnix_v2

    network = omnix_v2.OmniX(omnix_v2.NANO).train()
    images, height, width = 4, 84, 140
    pictures = torch.randn(images, 3, height, width)
    video, frame = torch.zeros(images, dtype=torch.long), torch.arange(images)
    depth, paths = torch.rand(images, height, width) + 0.5, torch.randn(images, images, height, width, 3)
    moving = (torch.rand(images, height, width) < 0.3).float()

    def loss():
        found = network(pictures, video, frame)
        depths = (found["depth"].reshape(depth.shape) - depth).abs().mean() + found["ray"].abs().mean()
        motion = (found["traj"].reshape(paths.shape) - paths).abs().mean()
        score = torch.nn.functional.binary_cross_entropy(found["score"].reshape(moving.shape).clamp(1e-6, 1 - 1e-6), moving)
        return depths + found["pose"].abs().mean() + motion + 0.01 * score

    return network, loss


network, loss = small() if sys.argv[1] == "small" else nano(sys.argv[3])
trained = [p for p in network.parameters() if p.requires_grad]
optimiser = torch.optim.AdamW(trained, lr=1e-4, betas=(0.9, 0.95), weight_decay=0.05)
seconds = []
for _ in range(int(sys.argv[2])):
    begun = time.perf_counter()
    optimiser.zero_grad(set_to_none=True)
    loss().backward()
    torch.nn.utils.clip_grad_norm_(trained, 1.0)
    optimiser.step()
    seconds.append(time.perf_counter() - begun)
print(json.dumps({"seconds": seconds, "parameters": sum(p.numel() for p in trained)}), file=answers, flush=True)
