"""Every field of a compiled mujoco.MjModel, in one of three tables: what is understood here, what cannot
change a motion, and what must be at its default. `supported` refuses what is in the last and is not.

A test walks all fields of the MuJoCo that is installed, so that a new one is looked at by a person before it
is listed. Names of `mujoco.MjOption` start with "opt.".
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import mujoco

    Rows = Callable[[mujoco.MjModel], np.ndarray]


def words(text: str) -> frozenset[str]:
    return frozenset(text.split())


UNDERSTOOD = words(
    """
    nq nv nu nactuator nbody njnt ngeom nsite nkey ntext nuser_geom opt names
    opt.timestep opt.gravity qpos0 qpos_spring
    body_parentid body_weldid body_jntnum body_jntadr body_pos body_quat body_ipos body_iquat body_mass
    body_inertia
    jnt_type jnt_qposadr jnt_dofadr jnt_bodyid jnt_limited jnt_actfrclimited jnt_pos jnt_axis jnt_stiffness
    jnt_range jnt_actfrcrange jnt_margin
    dof_jntid dof_armature dof_damping
    geom_type geom_contype geom_conaffinity geom_condim geom_bodyid geom_priority geom_size geom_pos geom_quat
    geom_friction geom_user geom_rgba
    site_bodyid site_pos site_quat
    exclude_signature
    actuator_trntype actuator_dyntype actuator_gaintype actuator_biastype actuator_outadr actuator_trnid
    actuator_ctrladr actuator_gainprm actuator_biasprm actuator_damping actuator_armature
    actuator_forcelimited actuator_forcerange actuator_ctrllimited actuator_ctrlrange actuator_gear
    text_adr text_data name_textadr key_qpos
    """
)
"""Read by `mjcf`, `drives`, `slots` and `load`; values that are not simulated are refused there or by
`supported`."""

WITHOUT_EFFECT = {
    reason: words(names)
    for reason, names in {
        "only shown": """
            vis geom_matid geom_group geom_castshadow
            site_type site_dataid site_matid site_group site_sameframe site_size site_rgba
            jnt_group actuator_group tendon_group tendon_matid tendon_width tendon_rgba
            ncam cam_mode cam_bodyid cam_targetbodyid cam_pos cam_quat cam_poscom0 cam_pos0 cam_mat0
            cam_projection cam_fovy cam_ipd cam_resolution cam_output cam_sensorsize cam_intrinsic
            nlight light_mode light_bodyid light_targetbodyid light_type light_texid light_castshadow
            light_bulbradius light_intensity light_range light_active light_pos light_dir light_poscom0
            light_pos0 light_dir0 light_attenuation light_cutoff light_softness light_exponent light_ambient
            light_diffuse light_specular
            nskin nskinvert nskintexvert nskinface nskinbone nskinbonevert skin_matid skin_group skin_rgba
            skin_inflate skin_vertadr skin_vertnum skin_texcoordadr skin_faceadr skin_facenum skin_boneadr
            skin_bonenum skin_vert skin_texcoord skin_face skin_bonevertadr skin_bonevertnum skin_bonebindpos
            skin_bonebindquat skin_bonebodyid skin_bonevertid skin_bonevertweight skin_pathadr
            ntex ntexdata tex_type tex_colorspace tex_height tex_width tex_nchannel tex_adr tex_data
            tex_pathadr tex_contenttypeadr
            nmat mat_texid mat_texuniform mat_texrepeat mat_emission mat_specular mat_shininess
            mat_reflectance mat_metallic mat_roughness mat_rgba
            """,
        "of meshes and height fields, which may only be shown": """
            geom_dataid nmesh nmeshvert nmeshnormal nmeshtexcoord nmeshface nmeshgraph nmeshpoly nmeshpolyvert
            nmeshpolymap mesh_vertadr mesh_vertnum mesh_faceadr mesh_facenum mesh_bvhadr mesh_bvhnum
            mesh_octadr mesh_octnum mesh_normaladr mesh_normalnum mesh_texcoordadr mesh_texcoordnum
            mesh_graphadr mesh_extrema mesh_vert mesh_normal mesh_texcoord mesh_face mesh_facenormal
            mesh_facetexcoord mesh_graph mesh_scale mesh_pos mesh_quat mesh_pathadr mesh_polynum mesh_polyadr
            mesh_polynormal mesh_polyvertadr mesh_polyvertnum mesh_polyvert mesh_polymapadr mesh_polymapnum
            mesh_polymap npolygonmax nmeshdegmax
            nhfield nhfielddata hfield_size hfield_nrow hfield_ncol hfield_adr hfield_data hfield_pathadr
            """,
        "only measured, named or noted down": """
            nsensor nsensordata sensor_type sensor_datatype sensor_needstage sensor_objtype sensor_objid
            sensor_reftype sensor_refid sensor_intprm sensor_dim sensor_adr sensor_cutoff sensor_noise
            sensor_history sensor_historyadr sensor_delay sensor_interval sensor_user sensor_plugin
            opt.magnetic nuserdata nuser_body nuser_jnt nuser_site nuser_cam nuser_tendon nuser_actuator
            nuser_sensor body_user jnt_user site_user cam_user tendon_user actuator_user
            nnumeric nnumericdata numeric_adr numeric_size numeric_data ntextdata text_size
            ntuple ntupledata tuple_adr tuple_size tuple_objtype tuple_objid tuple_objprm
            nnames npaths nnames_map names_map paths name_bodyadr name_jntadr name_geomadr name_siteadr
            name_camadr name_lightadr name_flexadr name_meshadr name_skinadr name_hfieldadr name_texadr
            name_matadr name_pairadr name_excludeadr name_eqadr name_tendonadr name_actuatoradr
            name_sensoradr name_numericadr name_tupleadr name_keyadr name_pluginadr
            """,
        "of keyframes, of which only poses are taken": """
            key_time key_qvel key_act key_mpos key_mquat key_ctrl key_plastic
            """,
        "how MuJoCo solves, not what": """
            stat opt.impratio opt.tolerance opt.ls_tolerance opt.noslip_tolerance opt.ccd_tolerance
            opt.integrator opt.cone opt.jacobian opt.solver opt.iterations opt.ls_iterations
            opt.noslip_iterations opt.ccd_iterations opt.sdf_initpoints opt.sdf_iterations
            narena nbuffer nemax njmax nconmax nhistory actuator_history actuator_historyadr signature
            """,
        "follows from other fields": """
            nout na nbvh nbvhstatic nbvhdynamic noct ntree nM nB nC nD nJten nJmom nexclude ngravcomp nplastic
            flg_gravcomp flg_surfacevel flg_adhesion
            body_rootid body_dofnum body_dofadr body_treeid body_geomnum body_geomadr body_simple
            body_sameframe body_subtreemass body_invweight0 body_margin body_contype body_conaffinity
            body_bvhadr body_bvhnum bvh_depth bvh_child bvh_nodeid bvh_aabb oct_depth oct_child oct_aabb
            oct_coeff jnt_actuatorid jnt_plasticadr
            dof_bodyid dof_parentid dof_treeid dof_Madr dof_simplenum dof_invweight0 dof_M0 dof_length
            tree_bodyadr tree_bodynum tree_dofadr tree_dofnum geom_sameframe geom_aabb geom_rbound
            actuator_ctrlnum actuator_outnum actuator_actadr actuator_actnum actuator_acc0 actuator_length0
            B_rownnz B_rowadr B_colind M_rownnz M_rowadr M_colind mapM2M D_rownnz D_rowadr D_diag D_colind
            mapM2D mapD2M
            """,
        "only beside something that is refused": """
            opt.wind opt.o_margin opt.o_solref opt.o_solimp opt.o_friction opt.sleep_tolerance
            tree_sleep_policy body_mocapid body_plugin jnt_actgravcomp dof_solref dof_solimp
            geom_plugin geom_solmix geom_gap geom_fluid
            actuator_ctrlspec actuator_cranklength actuator_dynprm actuator_actlimited actuator_actrange
            actuator_actearly actuator_plugin actuator_lengthrange
            npluginattr npluginstate plugin plugin_stateadr plugin_statenum plugin_attr plugin_attradr
            pair_dim pair_geom1 pair_geom2 pair_signature pair_solref pair_solreffriction pair_solimp
            pair_margin pair_gap pair_adhesion pair_friction
            neq eq_type eq_obj1id eq_obj2id eq_objtype eq_solref eq_solimp eq_data
            ntendon nwrap tendon_type tendon_adr tendon_num tendon_actuatorid tendon_plasticadr tendon_treenum
            tendon_treeid ten_J_rownnz ten_J_rowadr ten_J_colind tendon_actfrclimited tendon_solref_lim
            tendon_solimp_lim tendon_solref_fri tendon_solimp_fri tendon_range tendon_actfrcrange
            tendon_margin tendon_lengthspring tendon_springyield tendon_length0 tendon_invweight0
            wrap_type wrap_objid wrap_prm
            nflexnode nflexvert nflexedge nflexelem nflexelemdata nflexstiffness nflexbending nefm0dof nefm0L
            nefmCvert nflexelemedge nflexshelldata nflextexcoord nJfe
            flex_contype flex_conaffinity flex_condim flex_priority flex_solmix flex_solref flex_solimp
            flex_friction flex_margin flex_gap flex_selfcollide flex_activelayers flex_passive flex_dim
            flex_matid flex_group flex_interp flex_cellnum flex_nodeadr flex_nodenum flex_vertadr flex_vertnum
            flex_edgeadr flex_edgenum flex_elemadr flex_elemnum flex_elemdataadr flex_stiffnessadr
            flex_elemedgeadr flex_bendingadr flex_plasticadr flex_plasticmode flex_shellnum
            flex_shelldataadr flex_texcoordadr flex_nodebodyid flex_vertbodyid flex_vertcell flex_edge
            flex_edgeflap flex_elem flex_elemtexcoord flex_elemedge flex_elemlayer flex_shell flex_vert
            flex_vert0 flex_node flex_node0 flexedge_length0 flexedge_invweight0 flex_radius flex_size
            flex_stiffness flex_bending efm0_dofid efm0_L_rownnz efm0_L_rowadr efm0_L_colind efm0_L efmC_perm
            flex_damping flex_yield flex_edgestiffness flex_edgedamping flex_edgeequality flex_rigid
            flexedge_rigid flex_centered flex_flatskin flex_bvhadr flex_bvhnum flexedge_J_rownnz
            flexedge_J_rowadr flexedge_J_colind flex_rgba flex_texcoord
            """,
    }.items()
}


@dataclass(frozen=True)
class Default:
    """A field that must be as MuJoCo has it where a file does not say it."""

    word: str
    """how a file says it"""
    advice: str
    """what to do about it"""
    where: Rows | None = None
    """mask of the rows in which it can change a motion; None for all"""
    may: str = ""
    """names of the flags that a file may change all the same"""


def colliding(m: mujoco.MjModel) -> np.ndarray:
    """(ngeom,) geoms that may touch another."""
    return (m.geom_contype | m.geom_conaffinity) != 0


def limited(m: mujoco.MjModel) -> np.ndarray:
    """(njnt,) joints with a range."""
    return m.jnt_limited != 0


HARDNESS = "remove it: contacts here are as hard as a geom's user numbers erp and cfm say"
STIFF = "remove it: limits here are stiff springs of their own"
MUST_BE_DEFAULT = {
    "nflex": Default("flex", "use rigid bodies"),
    "nplugin": Default("plugin", "remove it from the file"),
    "npair": Default("contact pair", "let contype, conaffinity and exclude say which geoms meet"),
    "nmocap": Default("mocap body", "leave out mocap"),
    "opt.density": Default("density", "remove it: there is no fluid here"),
    "opt.viscosity": Default("viscosity", "remove it: there is no fluid here"),
    "opt.disableactuator": Default("actuatorgroupdisable", "remove the actuators instead"),
    "opt.disableflags": Default(
        "flag",
        "leave it enabled",
        may="equality frictionloss clampctrl warmstart refsafe sensor midphase eulerdamp autoreset nativeccd"
        " island multiccd",
    ),
    "opt.enableflags": Default(
        "flag",
        "leave it disabled",
        may="energy fwdinv invdiscrete diagexact speculative",
    ),
    "body_gravcomp": Default("gravcomp", "remove it"),
    "jnt_stiffnesspoly": Default("stiffness of second and third order", "give stiffness one number"),
    "jnt_springyield": Default("springyield", "remove it: springs here do not yield"),
    "jnt_solref": Default("solreflimit", STIFF, limited),
    "jnt_solimp": Default("solimplimit", STIFF, limited),
    "dof_dampingpoly": Default("damping of second and third order", "give damping one number"),
    "dof_frictionloss": Default("frictionloss", "use damping"),
    "geom_solref": Default("solref", HARDNESS, colliding),
    "geom_solimp": Default("solimp", HARDNESS, colliding),
    "geom_margin": Default("margin", "make the geom larger instead", colliding),
    "geom_surfacevel": Default("surfacevel", "remove it", colliding),
    "geom_adhesion": Default("adhesion", "remove it", colliding),
    "actuator_delay": Default("delay", "remove it, and give targets later"),
    "actuator_dampingpoly": Default("damping of second and third order", "give damping one number"),
    "eq_active0": Default("", "remove it, or say active='false'"),
    **{
        f"tendon_{field}": Default(word, "a tendon may only be measured: use joints' own")
        for field, word in {
            "limited": "limited",
            "stiffness": "stiffness",
            "stiffnesspoly": "stiffness",
            "damping": "damping",
            "dampingpoly": "damping",
            "frictionloss": "frictionloss",
            "armature": "armature",
        }.items()
    },
}
"""Refused by name where they are not; the default is that of `supported.plain`."""
