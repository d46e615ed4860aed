"""Files, local and remote: paths below a root, bounded reads, atomic writes, validated images.

All files that users name are opened here. A path is a `pathlib.Path`, or, for a URL, a `RemotePath` with the same
methods; `path_of` makes either from text.
"""

from appocc.files.images import (
    decoded_image,
    decoded_labels,
    open_picture,
    read_image,
    read_images,
    read_picture_bytes,
    write_image,
)
from appocc.files.local_copies import local_copy
from appocc.files.names import inside, plain_name, stays_inside
from appocc.files.questions import check_folder
from appocc.files.reading import (
    MOST_BYTES,
    MOST_TEXT_BYTES,
    digest_of,
    open_plain,
    read_file,
    read_json,
    read_text,
    unzipped,
    zip_arrays,
)
from appocc.files.remote_path import RemotePath, path_of
from appocc.files.store_requests import StoreError
from appocc.files.writing import whole_file, write_bytes, write_json

__all__ = [
    "MOST_BYTES",
    "MOST_TEXT_BYTES",
    "RemotePath",
    "StoreError",
    "check_folder",
    "decoded_image",
    "decoded_labels",
    "digest_of",
    "inside",
    "local_copy",
    "open_picture",
    "open_plain",
    "path_of",
    "plain_name",
    "read_file",
    "read_image",
    "read_images",
    "read_json",
    "read_picture_bytes",
    "read_text",
    "stays_inside",
    "unzipped",
    "whole_file",
    "write_bytes",
    "write_image",
    "write_json",
    "zip_arrays",
]
