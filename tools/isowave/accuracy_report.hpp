#pragma once
// How `verify` shows an oracle's judgement: a line of a table, and JSON.

#include <nlohmann/json.hpp>
#include <string_view>

#include "reference/accuracy.hpp"
#include "reference/clip_oracle.hpp"
#include "reference/layer_oracle.hpp"

namespace isowave::core::tools {

void print_accuracy_header(std::string_view what);
void print_accuracy(std::string_view name, const Accuracy &tally);
nlohmann::ordered_json quantiles_json(const Quantiles &quantiles);
nlohmann::ordered_json accuracy_json(const Accuracy &tally);

// The same of clipped frames.
void print_clip_accuracy_header(std::string_view what);
void print_clip_accuracy(std::string_view name, const ClipAccuracy &tally);
nlohmann::ordered_json clip_accuracy_json(const ClipAccuracy &tally);

// The same of frames with several and translucent surfaces.
void print_layer_accuracy_header(std::string_view what);
void print_layer_accuracy(std::string_view name, const LayerAccuracy &tally);
nlohmann::ordered_json layer_accuracy_json(const LayerAccuracy &tally);

}  // namespace isowave::core::tools
