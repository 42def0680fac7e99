"""How a model wants its picture, written into a TensorFlow Lite model.

MediaPipe's tasks read from the model's metadata how to scale 8-bit colours: (colour - mean) / std. The published pose
models are older than that and have none. A model is a flatbuffer; its metadata is another one in a buffer of its own.
"""

from typing import Any

from camera_client.pose_library import mediapipe

_NAME = b"TFLITE_METADATA"
_MODEL_MARK, _METADATA_MARK = b"TFL3", b"M001"


def with_normalisation(model: bytes, mean: float, std: float) -> bytes:
    """The same model, which says how to scale the colours of its first input.

    Args:
        model: A TensorFlow Lite model.
        mean: What is taken from a colour of 0 to 255.
        std: What the rest is divided by.

    Returns:
        The model with metadata; what it computes is the same.

    Raises:
        camera_client.pose_library.NoMediaPipe: MediaPipe, which knows the formats, is not here.
    """
    schema = mediapipe("mediapipe.tasks.metadata.schema_py_generated")
    tree = schema.ModelT.InitFromPackedBuf(model, 0)
    buffer = schema.BufferT()
    buffer.data = list(_metadata(mean, std, outputs=len(tree.subgraphs[0].outputs)))
    tree.buffers.append(buffer)
    entry = schema.MetadataT()
    entry.name, entry.buffer = _NAME, len(tree.buffers) - 1
    tree.metadata = [kept for kept in tree.metadata or [] if kept.name != _NAME] + [entry]
    return _packed(tree, _MODEL_MARK, len(model))


def _metadata(mean: float, std: float, outputs: int) -> bytes:
    schema = mediapipe("mediapipe.tasks.metadata.metadata_schema_py_generated")
    unit = schema.ProcessUnitT()
    unit.optionsType = schema.ProcessUnitOptions.NormalizationOptions
    unit.options = schema.NormalizationOptionsT()
    unit.options.mean, unit.options.std = [mean], [std]
    picture = schema.TensorMetadataT()
    picture.name = "image"
    picture.content = schema.ContentT()
    picture.content.contentPropertiesType = schema.ContentProperties.ImageProperties
    picture.content.contentProperties = schema.ImagePropertiesT()
    picture.content.contentProperties.colorSpace = schema.ColorSpaceType.RGB
    picture.processUnits = [unit]
    graph = schema.SubGraphMetadataT()
    graph.inputTensorMetadata = [picture]
    graph.outputTensorMetadata = [schema.TensorMetadataT() for _ in range(outputs)]
    whole = schema.ModelMetadataT()
    whole.subgraphMetadata = [graph]
    return _packed(whole, _METADATA_MARK, 256)


def _packed(tree: Any, mark: bytes, size: int) -> bytes:
    builder = mediapipe("flatbuffers").Builder(size)
    builder.Finish(tree.Pack(builder), mark)
    return bytes(builder.Output())
