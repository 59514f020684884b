"""The joint fit on exact paths; images over chains, against reflections in turn."""

import numpy as np

from estimator.path_consensus.flat_mirrors import Mirrors, chains_of
from estimator.path_consensus.joint_fit import fitted
from estimator.path_consensus.listed_paths import ListedPaths


def _mirrors() -> Mirrors:
    normal = np.array([[0.6, 0.8, 0.0], [-0.96, 0.28, 0.0], [0.0, 0.6, -0.8]])
    return Mirrors(normal=normal, offset=np.array([2.0, 3.0, 1.5]))


def test_an_image_over_a_chain_is_that_of_single_reflections_the_last_one_first() -> None:
    mirrors, user = _mirrors(), np.array([0.3, 0.9, 0.2])
    turn, shift = mirrors.images
    for number, chain in enumerate(chains_of(len(mirrors))):
        image = user
        for one in reversed(chain):
            normal = mirrors.normal[one]
            image = image + 2 * (mirrors.offset[one] - normal @ image) * normal
        np.testing.assert_allclose(turn[number] @ user + shift[number], image, atol=1e-12)


def test_a_user_behind_a_mirror_is_not_seen_over_it() -> None:
    mirrors = _mirrors()
    behind = (mirrors.offset[0] + 0.1) * mirrors.normal[0]
    assert not mirrors.reflects(behind[None])[0, 1]
    assert mirrors.reflects(0.5 * behind[None])[0, 1]


def test_exact_paths_over_all_chains_give_exactly_what_made_them() -> None:
    mirrors = _mirrors()
    users = np.array([[0.3, 0.9, 0.2], [-0.5, 1.2, 0.1], [0.1, 0.4, -0.6], [0.8, 0.2, 0.3]])
    turn, shift = mirrors.images
    images = (np.einsum("kij,uj->uki", turn, users) + shift).reshape(-1, 3)
    length = np.linalg.norm(images, axis=1)
    paths = ListedPaths(
        place=np.repeat(np.arange(len(users)), len(turn)),
        direction=images / length[:, None],
        length=length - 0.7,
        angle_deviation=0.01,
        length_deviation=0.02,
        places=len(users),
    )
    begin = Mirrors(normal=mirrors.normal + 0.02, offset=mirrors.offset + 0.05)
    begin = Mirrors(
        normal=begin.normal / np.linalg.norm(begin.normal, axis=1)[:, None], offset=begin.offset
    )
    chain = np.tile(np.arange(len(turn)), len(users))
    fit = fitted(paths, chain, begin, users + 0.05, 0.5, clock_known=False)
    np.testing.assert_allclose(fit.users, users, atol=1e-6)
    np.testing.assert_allclose(fit.mirrors.normal, mirrors.normal, atol=1e-6)
    np.testing.assert_allclose(fit.mirrors.offset, mirrors.offset, atol=1e-6)
    assert abs(fit.offset - 0.7) < 1e-6
    assert fit.chi_square < 1e-6


def test_a_users_covariance_is_that_of_its_image_where_the_direct_path_alone_tells_it() -> None:
    paths = ListedPaths(
        place=np.array([0]),
        direction=np.array([[0.6, 0.8]]),
        length=np.array([5.0]),
        angle_deviation=0.01,
        length_deviation=0.02,
        places=1,
    )
    none = Mirrors(normal=np.zeros((0, 2)), offset=np.zeros(0))
    fit = fitted(paths, np.array([0]), none, paths.images(0.0), 0.0, clock_known=True)
    np.testing.assert_allclose(fit.user_covariance[0], paths.covariance(0.0)[0], rtol=1e-6)
