"""Makes the libraries of the extra `train` ready before anything imports them."""

import os

from agentflow.extras import is_installed, missing

ENVIRONMENT = {
    "OMP_WAIT_POLICY": "PASSIVE",  # idle threads sleep: generation is 18 times as fast on 2 cores
    "TOKENIZERS_PARALLELISM": "false",
    "HF_HUB_DISABLE_PROGRESS_BARS": "1",
    "HF_DATASETS_DISABLE_PROGRESS_BARS": "1",
    "TRANSFORMERS_VERBOSITY": "error",
}
"""How the libraries should behave, unless the user has said otherwise."""


NOT_IN_EXTRA = ("bitsandbytes", "vllm", "gensim")
"""Libraries that the extra leaves out: the first two need a GPU, the last has no build for
Python 3.14 yet, so the extra leaves it out there."""


def require_libraries(*names: str) -> None:
    """Refuse to go on without these libraries; set the environment that the others read.

    Raises:
        ConfigError: One is not installed.
    """
    for name in names:
        if not is_installed(name):
            raise missing(name, "" if name in NOT_IN_EXTRA else "train")
    for key, value in ENVIRONMENT.items():
        os.environ.setdefault(key, value)
