#pragma once
// How `verify` shows an oracle's judgement: a line of a table, and JSON.

#include <nlohmann/json.hpp>
#include <string_view>

#include "reference/accuracy.hpp"

namespace isowave::core::tools {

void print_accuracy_header(std::string_view what);
void print_accuracy(std::string_view name, const Accuracy &tally);
nlohmann::ordered_json quantiles_json(const Quantiles &quantiles);
nlohmann::ordered_json accuracy_json(const Accuracy &tally);

}  // namespace isowave::core::tools
