"""Raw outputs of policy.onnx with onnxruntime: onnx_answers.py FOLDER GRIDS.npy OUTPUTS.npy"""

import sys
from pathlib import Path

import numpy as np
import onnx
import onnxruntime

if __name__ == "__main__":
    folder, grids, outputs = sys.argv[1:]
    file = str(Path(folder) / "policy.onnx")
    onnx.checker.check_model(file, full_check=True)
    session = onnxruntime.InferenceSession(file, providers=["CPUExecutionProvider"])
    (answers,) = session.run(["point"], {"grid": np.load(grids).astype(np.float32)[:, None]})
    np.save(outputs, answers)
