"""Simulations that a program controls: state, pins, wind, obstacles, own forces, snapshots."""

import copy
import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import energy_dsl as ed

SHEET = {
    "dt": 0.01, "duration": 0.5, "gravity": [0.0, 0.0, -9.81], "integrator": "newton", "contact": "off",
    "mesh": {"sheet": {"cells": [4, 4], "size": [0.4, 0.4]}},
    "fabric": {"density": 0.2, "material": {"stvk": {"stretch_stiffness": 60.0, "poisson_ratio": 0.3}}},
    "pins": [{"nearest": [-0.2, 0.2, 0.0]}, {"nearest": [0.2, 0.2, 0.0]}],
}
BALL = {**SHEET, "contact": "on", "obstacles": [{"name": "ball", "sphere": {"centre": [0, 0, -0.2], "radius": 0.1}}]}
PULL = "energy Pull(p: Point; t: Vec3, k: Scalar) { k / 2 * norm_squared(p - t) }"
INTEGRATORS = ["newton", "implicit-euler", "bdf2", "implicit-midpoint", "trapezoid"]


def simulated(scene=SHEET, **options):
    return ed.Simulation(scene, threads=1, **options)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_controls_that_are_not_used_change_no_bit(integrator):
    scene = {**SHEET, "integrator": integrator, "wind": {"velocity": [1.0, 2.0, 0.0]}}
    closed, opened = simulated(scene), simulated(scene, wind=True)
    closed.step(5), opened.step(5)
    assert np.array_equal(closed.positions, opened.positions) and opened.wind == [1.0, 2.0, 0.0]


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_pins_are_moved_and_follow_to_the_digit(integrator):
    simulation = simulated({**SHEET, "integrator": integrator})
    pins = simulation.pinned
    assert len(pins) == 2
    target = simulation.positions[pins]
    for step in range(6):
        target = target + [0.0, 0.005, 0.01]
        simulation.move_pins(pins, target)
        simulation.step()
        np.testing.assert_allclose(simulation.positions[pins], target, atol=1e-13)
    simulation.step(2)
    np.testing.assert_allclose(simulation.positions[pins], target, atol=1e-13)
    simulation.move_pins()
    simulation.step(3)
    np.testing.assert_allclose(simulation.positions[pins], target, atol=1e-13)
    with pytest.raises(ValueError, match="vertex 12 is not pinned"):
        simulation.move_pins([12], [[0, 0, 0]])
    with pytest.raises(ValueError, match=r"targets: expected shape \(1, 3\), got \(2, 3\)"):
        simulation.move_pins(pins[:1], np.zeros((2, 3)))
    with pytest.raises(ValueError, match="no vertex 99"):
        simulation.move_pins([99], [[0, 0, 0]])
    with pytest.raises(ValueError, match="NaN"):
        simulation.move_pins(pins[:1], [[0, 0, np.nan]])


def test_moving_a_pin_equals_a_motion_of_the_scene():
    keys = [{"time": 0.0}, {"time": 0.5, "translate": [0.0, 0.1, 0.2]}]
    pins = [{**pin, "motion": {"keys": keys}} for pin in SHEET["pins"]]
    scripted, driven = simulated({**SHEET, "pins": pins}), simulated()
    start = driven.positions[driven.pinned]
    for step in range(1, 11):
        driven.move_pins(driven.pinned, start + 0.02 * step * np.array([0.0, 0.1, 0.2]))
        driven.step(), scripted.step()
    np.testing.assert_allclose(driven.positions, scripted.positions, atol=1e-9)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_own_text_equals_a_weight(integrator):
    scene = {**SHEET, "integrator": integrator}
    weightless = {**scene, "gravity": [0.0, 0.0, 0.0]}
    plain = simulated(scene)
    text = "energy Weight(p: Point; m, g: Scalar) { m * g * p.z }"
    own = (ed.energy(text), np.arange(25)[:, None], {"m": plain.masses, "g": 9.81})
    masses = plain.masses
    force = ed.OwnForce(lambda x, v, order: np.stack([0 * masses, 0 * masses, -9.81 * masses], 1)[:, None], own[1])
    energy = ed.OwnEnergy(
        lambda x, order: (9.81 * masses * x[:, 0, 2], np.stack([0 * masses, 0 * masses, 9.81 * masses], 1)[:, None]),
        own[1],
        hessians=False,
    )
    plain.step(5)
    for forces in ({"weight": own}, {"weight": force}, {"weight": energy}):
        simulation = simulated(weightless, forces=forces)
        simulation.step(5)
        np.testing.assert_allclose(simulation.positions, plain.positions, atol=1e-8)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_functions_equal_the_text(integrator):
    t, k = np.array([0.1, -0.1, 0.3]), 5.0
    stencils = np.array([[0], [7], [22]])
    own = (ed.energy(PULL), stencils, {"t": t, "k": k})
    text = simulated({**SHEET, "integrator": integrator}, forces={"pull": own})
    orders = set()

    def pull(x, order):
        orders.add(order)
        d = x[:, 0] - t
        results = (k / 2 * (d**2).sum(1), k * d[:, None], np.broadcast_to(k * np.eye(3), (3, 3, 3)))
        return results[: order + 1]

    function = simulated({**SHEET, "integrator": integrator}, forces={"pull": ed.OwnEnergy(pull, stencils)})
    for simulation in (text, function):
        simulation.step(8)
    assert 2 in orders
    np.testing.assert_allclose(text.positions, function.positions, atol=1e-7)
    forces = dict(text.term_forces())
    free = text.positions[stencils[:, 0]]
    np.testing.assert_allclose(forces["pull"][stencils[:, 0]], -k * (free - t), atol=1e-12)
    moved = np.setdiff1d(np.arange(25), text.pinned)
    np.testing.assert_allclose(forces["gravity"][moved, 2], -9.81 * text.masses[moved], rtol=1e-12)


def test_parameters_of_own_texts_change_between_steps():
    stencils = [[4]]
    simulation = simulated(forces={"grip": (ed.energy(PULL), stencils, {"t": [0.2, -0.2, 0.2], "k": 0.0})})
    reference = simulated()
    simulation.step(5), reference.step(5)
    np.testing.assert_allclose(simulation.positions, reference.positions, atol=1e-9)
    simulation.set("grip", k=500.0)
    assert simulation.inputs_of("grip")["k"] == 500.0
    simulation.step(45)
    assert np.linalg.norm(simulation.positions[4] - [0.2, -0.2, 0.2]) < 0.02
    with pytest.raises(KeyError, match="no own text .grab.; there are: grip"):
        simulation.set("grab", k=1.0)


@pytest.mark.parametrize("scene", [SHEET, BALL])
def test_exceptions_of_functions_end_the_step_and_keep_the_state(scene):
    class Stop(Exception):
        pass

    def fails(x, order):
        if simulation.armed:
            raise Stop("enough")
        return (np.zeros(1), np.zeros((1, 1, 3)), np.zeros((1, 3, 3)))[: order + 1]

    class Own(ed.Simulation):
        armed = False

    simulation = Own(scene, threads=1, forces={"own": ed.OwnEnergy(fails, [[3]])})
    simulation.step(2)
    before = simulation.positions
    simulation.armed = True
    with pytest.raises(Stop, match="enough"):
        simulation.step(5)
    assert np.array_equal(simulation.positions, before) and simulation.steps_done == 2
    simulation.armed = False
    assert simulation.step(1) == 1


def test_wrong_results_of_functions_say_what_was_expected():
    wrong = [
        (lambda x, order: np.zeros(2), r"own, U: expected shape \(1,\), got \(2,\)"),
        (lambda x, order: (np.zeros(1), np.zeros((1, 3)))[: order + 1], r"own, gradient: expected shape \(1, 1, 3\)"),
        (lambda x, order: np.zeros(1), "own: expected gradient as result 1 at order"),
    ]
    for function, message in wrong:
        with pytest.raises(ValueError, match=message):
            simulated(forces={"own": ed.OwnEnergy(function, [[3]])}).step()
    with pytest.raises(TypeError, match="forces, own: expected .* got int"):
        simulated(forces={"own": 3})
    with pytest.raises(TypeError, match="OwnForce: expected a function"):
        ed.OwnForce(3, [[1]])
    with pytest.raises(ValueError, match="row 0 names vertex 25"):
        simulated(forces={"own": (ed.energy(PULL), [[25]], {"t": [0, 0, 0], "k": 1})})


def test_elements_that_join_what_moves_on_its_own_are_refused_with_a_remedy():
    two = {key: value for key, value in SHEET.items() if key not in ("mesh", "fabric", "pins")}
    garment = {"mesh": SHEET["mesh"], "fabric": SHEET["fabric"]}
    placed = {"translate": [0.0, 0.0, 0.5]}
    two["garment"] = [{"name": "a", **garment}, {"name": "b", "placement": placed, **garment}]
    spring = ed.energy("energy Spring(p, q: Point; k: Scalar) { k / 2 * norm_squared(p - q) }")
    with pytest.raises(ValueError, match='joins vertices 0 and 25, which move on their own.* set `contact = "on"`'):
        simulated(two, forces={"tie": (spring, [[0, 25]], {"k": 1.0})})
    both = simulated(two, forces={"pull": (ed.energy(PULL), [[0], [30]], {"t": [0.0, 0, 0], "k": [1.0, 2.0]})})
    forces = dict(both.term_forces())["pull"]
    np.testing.assert_allclose(forces[[0, 30]], -both.positions[[0, 30]] * [[1.0], [2.0]], atol=1e-12)
    both.set("pull", k=[3.0, 4.0])
    both.step()
    forces, x = dict(both.term_forces())["pull"], both.positions
    np.testing.assert_allclose(forces[[0, 30]], -x[[0, 30]] * [[3.0], [4.0]], atol=1e-12)


def test_obstacles_are_moved_and_push_the_cloth():
    simulation = simulated(BALL, obstacles=["ball"])
    for step in range(20):
        simulation.move_obstacle("ball", [0.0, 0.0, 0.015 * (step + 1)])
        simulation.step()
    assert simulation.positions[12, 2] > 0.15, "the ball lifts the middle of the sheet"
    R, t = simulation.obstacle_pose("ball")
    assert np.array_equal(R, np.eye(3)) and t[2] == pytest.approx(0.3)
    contacts = simulation.contacts()
    assert len(contacts.vertices) and (contacts.vertices == -1).any() and (contacts.forces > 0).all()
    assert (contacts.distances > 0).all() and np.allclose(np.linalg.norm(contacts.normals, axis=1), 1)
    assert simulation.contact_forces[:, 2].sum() > 0
    with pytest.raises(ValueError, match="no obstacle called `bal` that a program may move; there are ball"):
        simulation.move_obstacle("bal")
    with pytest.raises(ValueError, match="rotation: expected a rotation"):
        simulation.move_obstacle("ball", rotation=2 * np.eye(3))
    with pytest.raises(ValueError, match="no obstacle called `cube`"):
        simulated(BALL, obstacles=["cube"])


def test_a_steered_obstacle_equals_its_keys():
    keys = [{"time": 0.0}, {"time": 0.5, "translate": [0.0, 0.0, 0.25]}]
    ball = {**BALL["obstacles"][0], "friction": 0.3}
    scripted = simulated({**BALL, "obstacles": [{**ball, "motion": {"keys": keys}}]})
    driven = simulated({**BALL, "obstacles": [ball]}, obstacles=["ball"])
    for step in range(1, 16):
        driven.move_obstacle("ball", [0.0, 0.0, 0.5 * 0.01 * step])
        driven.step(), scripted.step()
    np.testing.assert_allclose(driven.positions, scripted.positions, atol=1e-7)


def test_wind_blows_as_it_is_told():
    scene = {**SHEET, "wind": {"velocity": [0.0, 0.0, 0.0]}}
    simulation, still = simulated(scene, wind=True), simulated(scene)
    simulation.wind = [0.0, 8.0, 0.0]
    simulation.step(30), still.step(30)
    assert simulation.positions[:, 1].mean() > still.positions[:, 1].mean() + 0.02
    with pytest.raises(ValueError, match="the wind is that of the scene"):
        still.wind = [1.0, 0.0, 0.0]
    with pytest.raises(ValueError, match="the scene has no wind"):
        simulated(wind=True)


@pytest.mark.parametrize("scene", [SHEET, BALL, {**SHEET, "integrator": "bdf2"}])
def test_snapshots_go_back_with_the_same_bits(scene):
    options = {"forces": {"grip": (ed.energy(PULL), [[4]], {"t": [0.2, -0.2, 0.2], "k": 1.0})}}
    if "obstacles" in scene:
        options["obstacles"] = ["ball"]
    simulation = simulated(scene, **options)
    first = simulation.positions
    pins = simulation.pinned
    simulation.move_pins(pins, first[pins] + [0, 0, 0.01])
    if "obstacles" in scene:
        simulation.move_obstacle("ball", [0, 0, 0.02])
    simulation.step(5)
    simulation.set("grip", k=20.0)
    snapshot = pickle.loads(pickle.dumps(simulation.snapshot()))
    assert snapshot.steps_done == 5 and np.array_equal(snapshot.positions, simulation.positions)
    copies = [copy.deepcopy(simulation), pickle.loads(pickle.dumps(simulation))]
    simulation.step(10)
    expected = simulation.positions
    simulation.set("grip", k=0.0)
    simulation.move_pins()
    simulation.restore(snapshot)
    simulation.step(10)
    assert np.array_equal(simulation.positions, expected)
    for other in copies:
        assert other.steps_done == 5
        other.step(10)
        assert np.array_equal(other.positions, expected)
    for again in (simulation, *copies):
        again.reset()
        assert again.steps_done == 0 and np.array_equal(again.positions, first) and again.inputs_of("grip")["k"] == 1.0


def test_positions_and_velocities_are_set():
    simulation = simulated()
    x = simulation.positions
    simulation.positions = x + [0, 0, 1.0]
    assert np.array_equal(simulation.positions, x + [0, 0, 1.0])
    simulation.velocities = np.full((25, 3), 2.0)
    pins = simulation.pinned
    assert not simulation.velocities[pins].any() and (np.delete(simulation.velocities, pins, 0) == 2.0).all()
    simulation.step()
    assert np.array_equal(simulation.positions[pins], x[pins] + [0, 0, 1.0])
    assert (np.delete(simulation.positions, pins, 0)[:, 0] > np.delete(x, pins, 0)[:, 0]).all()
    with pytest.raises(ValueError, match=r"positions: expected shape \(25, 3\), got \(24, 3\)"):
        simulation.positions = x[1:]
    with pytest.raises(ValueError, match="NaN"):
        simulation.velocities = np.full((25, 3), np.nan)


def test_positions_that_cross_are_refused_and_nothing_changes():
    simulation = simulated(BALL)
    x = simulation.positions
    inside = x - [0, 0, 0.2]
    with pytest.raises(ValueError, match="vertex 12 would be inside ball"):
        simulation.positions = inside
    folded = x.copy()
    folded[[0, 1]] = [[0.03, 0.05, -0.05], [0.04, 0.06, 0.05]]
    with pytest.raises(ValueError, match="edges would cross triangles"):
        simulation.positions = folded
    assert np.array_equal(simulation.positions, x)
    simulation.step(3)


def test_the_ledger_is_an_array():
    simulation = simulated(forces={"pull": (ed.energy(PULL), [[4]], {"t": [0.2, -0.2, 0.2], "k": 5.0})})
    with pytest.raises(RuntimeError, match="no ledger is kept"):
        simulation.ledger()
    simulation.keep_ledger()
    simulation.step(10)
    ledger = simulation.ledger()
    assert ledger["time"].shape == (11,) and ledger["time"][-1] == pytest.approx(0.1)
    distance = np.linalg.norm(simulation.positions[4] - [0.2, -0.2, 0.2])
    assert ledger["pull"][-1] == pytest.approx(2.5 * distance**2, rel=1e-9)
    assert {"kinetic", "work of pins"} <= set(ledger)


def test_threads_step_many_instances():
    instances = [simulated() for _ in range(4)]
    alone = simulated()
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(lambda simulation: simulation.step(10), instances))
    alone.step(10)
    assert all(np.array_equal(simulation.positions, alone.positions) for simulation in instances)


STIFFNESS = "fabric.material.stvk.stretch_stiffness"


def test_changed_parameters_act_as_those_of_a_scene_that_always_had_them():
    own = (ed.energy(PULL), [[12]], {"t": [0.0, 0.0, 0.1], "k": 2.0})
    changed = simulated(forces={"pull": own})
    changed.change({STIFFNESS: np.float64(120.0), "fabric.density": 0.3})
    stiff = {"density": 0.3, "material": {"stvk": {"stretch_stiffness": 120.0, "poisson_ratio": 0.3}}}
    always = simulated({**SHEET, "fabric": stiff}, forces={"pull": own})
    changed.step(5), always.step(5)
    assert np.array_equal(changed.positions, always.positions)
    changed.set("pull", k=5.0), always.set("pull", k=5.0)
    changed.step(5), always.step(5)
    assert np.array_equal(changed.positions, always.positions)


def test_a_change_keeps_state_controls_reset_and_pickles():
    simulation = simulated(BALL, obstacles=["ball"])
    pins, start = simulation.pinned, simulation.positions
    simulation.move_pins(pins, start[pins] + [0.0, 0.0, 0.01])
    simulation.move_obstacle("ball", [0.0, 0.0, 0.02])
    simulation.step(3)
    x, v = simulation.positions, simulation.velocities
    for stiffness in (80.0, 100.0):
        simulation.change({STIFFNESS: stiffness})
        assert np.array_equal(simulation.positions, x) and np.array_equal(simulation.velocities, v)
    other = pickle.loads(pickle.dumps(simulation))
    simulation.step(3), other.step(3)
    assert np.array_equal(simulation.positions, other.positions)
    np.testing.assert_allclose(simulation.positions[pins], start[pins] + [0.0, 0.0, 0.01], atol=1e-12)
    for one in (simulation, other):
        one.reset()
        assert np.array_equal(one.positions, start) and one.steps_done == 0
        one.change({"fabric.density": 0.4})
        one.step(2)
    assert np.array_equal(simulation.positions, other.positions)


def test_a_change_that_does_not_fit_is_refused_and_changes_nothing():
    simulation, untouched = simulated(), simulated()
    simulation.step(2), untouched.step(2)
    with pytest.raises(ValueError, match="another number of vertices"):
        simulation.change({"mesh.sheet.cells": [5, 5]})
    with pytest.raises(ValueError, match="another time step"):
        simulation.change({"dt": 0.02})
    with pytest.raises(ValueError, match="stretch_stifness"):
        simulation.change({"fabric.material.stvk.stretch_stifness": 1.0})
    simulation.step(2), untouched.step(2)
    assert np.array_equal(simulation.positions, untouched.positions)
