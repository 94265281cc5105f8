#pragma once
// Requests, scenes and options of renderers as Python's dicts, by the names of their fields.

#include "module.hpp"

namespace isowave_python {

/// "smooth", "cell".
isowave::Normals normals_of(const std::string &name);
/// Fields that are not there, or None, have their defaults. Python does not set
/// FrameRequest::bound.
isowave::FrameRequest request_of(const nb::dict &options);
isowave::Annotations annotations_of(const nb::dict &fields);
isowave::Scene scene_of(const nb::dict &fields);
isowave::RendererOptions renderer_options_of(const nb::dict &options);

/// Dicts of groups.
nb::list list_of(const std::vector<isowave::AnnotationGroup> &groups);

/// All fields.
nb::dict dict_of(const isowave::Scene &scene);

}  // namespace isowave_python
