import numpy as np
import pytest
import torch
from tolerances import assert_rounded
from torch import nn

from appocc.models.rounding import count_terms, rounding


def test_two_orders_of_a_sum_differ_by_rounding_and_a_lost_term_by_more() -> None:
    terms = torch.rand(10_000, generator=torch.Generator().manual_seed(1))
    one_by_one = np.cumsum(terms.numpy(), dtype=np.float32)[-1]
    assert one_by_one != terms.double().sum()
    assert_rounded(one_by_one, terms.sum(), len(terms))
    with pytest.raises(AssertionError):
        assert_rounded(terms[5:].sum(), terms.sum(), len(terms))


def test_coarser_types_and_longer_sums_round_more() -> None:
    assert rounding(100) == 10 * rounding(1)
    assert rounding(1, torch.bfloat16) > rounding(1, torch.float16) > rounding(1) > rounding(1, torch.float64)


def test_terms_are_the_weights_of_an_output_layer_by_layer() -> None:
    assert count_terms(nn.Sequential(nn.Conv2d(3, 8, 3), nn.BatchNorm2d(8), nn.Conv2d(8, 8, 5, groups=8))) == 27 + 25


def test_nothing_hides_behind_what_is_no_number() -> None:
    with pytest.raises(AssertionError):
        assert_rounded([1.0, np.nan], [1.0, 2.0])
    assert_rounded([1.0, np.nan], [1.0, np.nan])
