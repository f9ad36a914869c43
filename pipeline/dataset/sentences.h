// Makes sentences for people: the meaning of a verdict, a reason and a kind of label, and the grounds of a
// candidate's verdict.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "filters/fidelity.h"
#include "manifests/verdict.h"
#include "pipeline/config/role.h"

namespace q3d::pipeline::dataset {

// Each enumerator has a sentence of its own; a new one without a sentence does not compile.
std::string_view sentence(manifests::Verdict verdict);
std::string_view sentence(manifests::Reason reason);
std::string_view sentence(manifests::LabelKind kind);

// Returns a sentence that says what decided about a candidate, in its own numbers. A candidate with a reason
// is always explained by its reason. `thresholds` are those of its dataset; they are needed where the
// fidelity rule decided. Throws std::runtime_error if they are missing there.
std::string why(const manifests::Judgement& judgement, config::Role role,
                const std::optional<filters::Thresholds>& thresholds);

struct DatasetManifest;

// Returns a text about the quality of the labels: their distance from the annotated keypoints, relative to
// the crop, and what this distance does not prove.
std::string quality_sentence(const DatasetManifest& manifest);

}  // namespace q3d::pipeline::dataset
